"""What the log and ``/diagnostics`` say of the stream."""

from __future__ import annotations

from diagnostic_msgs.msg import DiagnosticArray

from midastouch_common.ros.lifecycle import RobustLifecycleNode

from ..frame_slot import ReaderState, ReaderStatus
from ..frame_source import Frame
from ..stream_monitor import StreamMonitor
from . import messages
from .parameters import Value


class StreamReport:
    """Watches the stream of one node, which gives up when that has failed for good.

    Args:
        node: whose stream it is.
        values: of the node's parameters, as they are at any moment.
    """

    def __init__(self, node: RobustLifecycleNode, values: dict[str, Value]) -> None:
        self._node, self._values = node, values
        self._monitor = StreamMonitor()
        self._told = ReaderStatus()
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", 10)

    def begin(self) -> None:
        """The stream begins anew: what was told of an earlier one counts no more."""
        self._told = ReaderStatus()

    def stamp(self, frame: Frame) -> int:
        """Takes note of a frame and returns its acquisition in wall time, nanoseconds."""
        return self._monitor.stamp(frame)

    def tell(self, status: ReaderStatus) -> None:
        """Logs what happened to the source since the last call, once."""
        log = self._node.get_logger()
        before, self._told = self._told, status
        if status.info is not None and (before.info is None or status.reconnects != before.reconnects):
            self._monitor.opened(status.info)
            log.info(f"{self._values['camera_name']}: {status.info}")
            for warning in status.info.warnings:
                log.warning(warning)
        if (status.state, status.last_error) == (before.state, before.last_error):
            return
        if status.state is ReaderState.FAILED:
            self._node.give_up(status.last_error)
        elif status.state is ReaderState.ENDED:
            log.info("the recording was played to its end")
        elif status.last_error != before.last_error:
            log.warning(f"{status.state.value}: {status.last_error}", throttle_duration_sec=5.0)

    def publish(self, status: ReaderStatus) -> None:
        """Publishes the verdict on the stream now."""
        hardware_id = (status.info.serial or status.info.name) if status.info else self._values["serial"]
        name = f"{self._node.get_fully_qualified_name().lstrip('/')}: stream"
        stamp = self._node.get_clock().now().to_msg()
        report = self._monitor.report(status, self._values["stamp_jitter_limit"])
        if report.uneven:
            self._node.get_logger().warning(report.uneven, throttle_duration_sec=30.0)
        self._publisher.publish(messages.diagnostics_message(report, name, hardware_id, stamp))
