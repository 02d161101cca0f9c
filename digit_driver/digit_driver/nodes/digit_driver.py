"""The ``digit_driver`` node: a DIGIT (or a recording of one) as a ROS 2 camera."""

from __future__ import annotations

import sys

from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from std_msgs.msg import Header
from std_srvs.srv import SetBool

from ..calibration import Calibration, load_calibration
from ..errors import DeviceError, InputError
from ..frame_slot import ReaderState, ReaderStatus
from ..frame_source import Frame, FrameSource
from ..reader import FrameReader
from ..ros import spin
from ..ros.lifecycle import RobustLifecycleNode
from ..stream_monitor import StreamMonitor
from . import messages, settings
from .parameters import PARAMETERS, declare, refuse_unknown

IMAGE_QOS = QoSProfile(depth=2)
"""Reliable, volatile: serves best-effort subscribers as well (REP 2003)."""

_FIRST_OPEN_S = 5.0


class DigitDriver(RobustLifecycleNode):
    """Publishes ``image_raw``, ``image_raw/compressed``, ``camera_info``, diagnostics; has ``set_capture``.

    Configuring checks the settings, activating opens the source; ``autostart`` does both on construction.

    Args:
        kwargs: passed on to rclpy's node, e.g. ``parameter_overrides``, ``namespace``, ``context``.

    Raises:
        InputError: a parameter cannot be used or, with ``autostart``, the source that it names.
    """

    def __init__(self, **kwargs) -> None:
        super().__init__("digit_driver", **kwargs)
        self._source: FrameSource | None = None
        self._reader: FrameReader | None = None
        self._calibration: Calibration | None = None
        self._monitor = StreamMonitor()
        self._reported = ReaderStatus()
        try:
            self._values = declare(self, PARAMETERS)
            self._wire()
            refuse_unknown(self)
            settings.refuse_sim_time(self.get_parameter("use_sim_time").value)
            if self._values["autostart"] and not self.start():
                raise InputError(self.failure)
        except BaseException as error:
            # Also on a signal during the start: the reader's thread must not outlive the node.
            if isinstance(error, InputError) and str(error) != self.failure:
                self.give_up(str(error))
            self.destroy_node()
            raise

    def _wire(self) -> None:
        options = {"qos_overriding_options": QoSOverridingOptions.with_default_policies()}
        self._image_pub = self.create_publisher(Image, "image_raw", IMAGE_QOS, **options)
        self._jpeg_pub = self.create_publisher(CompressedImage, "image_raw/compressed", IMAGE_QOS, **options)
        self._info_pub = self.create_publisher(CameraInfo, "camera_info", IMAGE_QOS, **options)
        self._diagnostics_pub = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._wake = self.create_guard_condition(self._on_reader_event)
        # steady: a wall clock that is set back would silence a timer of its own for as long
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(self._values["diagnostics_period"], self._publish_diagnostics, clock=steady)
        self.create_service(SetBool, "set_capture", self._on_set_capture)
        self.add_on_set_parameters_callback(self._check_parameters)
        self.add_post_set_parameters_callback(self._apply_parameters)

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        values = self._values
        try:
            self._source = settings.source(values)
            self._calibration = load_calibration(values["camera_info_url"], settings.image_size(values))
        except InputError as error:
            return self.give_up(str(error))
        self._reader = FrameReader(self._source, self._wake.trigger, settings.timing(values))
        if self.get_namespace() == "/" and not values["replay_path"]:
            self.get_logger().warning("in the global namespace; better: --ros-args -r __ns:=/digit_left")
        return TransitionCallbackReturn.SUCCESS

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        try:
            self._begin_capture()
        except (DeviceError, InputError) as error:
            return self.give_up(str(error))
        self.failure = ""
        return TransitionCallbackReturn.SUCCESS

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        self._end_capture()
        return TransitionCallbackReturn.SUCCESS

    on_shutdown = on_deactivate

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        self._reader = self._source = None
        return TransitionCallbackReturn.SUCCESS

    def destroy_node(self) -> None:
        # First the thread that wakes us, then what it wakes.
        self._end_capture()
        super().destroy_node()

    def _begin_capture(self) -> None:
        """Raises DeviceError or InputError if the source can be said at once not to work."""
        self._reported = ReaderStatus()
        self._reader.start()
        self._reader.wait_settled(_FIRST_OPEN_S)
        status = self._reader.status()
        if status.state is ReaderState.FAILED:
            self._reader.stop()
            raise InputError(status.last_error)
        self._report_changes(status)

    def _end_capture(self) -> None:
        if self._reader is not None and not self._reader.stop():
            self.get_logger().error("the device driver hangs in the kernel; leaving it behind")

    def _on_reader_event(self) -> None:
        if self._reader is None:
            return
        self._report_changes(self._reader.status())
        frame = self._reader.take()
        if frame is not None:
            self._publish(frame)

    def _report_changes(self, status: ReaderStatus) -> None:
        """Logs what happened to the source since the last call, once."""
        before, self._reported = self._reported, status
        if status.info is not None and (before.info is None or status.reconnects != before.reconnects):
            self._monitor.opened(status.info)
            self.get_logger().info(f"{self._values['camera_name']}: {status.info}")
            for warning in status.info.warnings:
                self.get_logger().warning(warning)
        if (status.state, status.last_error) == (before.state, before.last_error):
            return
        if status.state is ReaderState.FAILED:
            self.give_up(status.last_error)
        elif status.state is ReaderState.ENDED:
            self.get_logger().info("the recording was played to its end")
        elif status.last_error != before.last_error:
            self.get_logger().warning(f"{status.state.value}: {status.last_error}", throttle_duration_sec=5.0)

    def _publish(self, frame: Frame) -> None:
        wall_ns = self._monitor.stamp(frame) + self._values["timestamp_offset"]
        header = Header(stamp=messages.time_message(wall_ns), frame_id=self._values["frame_id"])
        if self._image_pub.get_subscription_count():
            self._image_pub.publish(messages.image_message(frame.image, header))
        if self._jpeg_pub.get_subscription_count():
            quality = self._values["jpeg_quality"]
            self._jpeg_pub.publish(messages.compressed_message(frame.image, header, quality))
        self._info_pub.publish(messages.camera_info_message(self._calibration, header))

    def _publish_diagnostics(self) -> None:
        status = self._reader.status() if self._reader else ReaderStatus()
        hardware_id = (status.info.serial or status.info.name) if status.info else self._values["serial"]
        name = f"{self.get_fully_qualified_name().lstrip('/')}: stream"
        stamp = self.get_clock().now().to_msg()
        report = self._monitor.report(status, self._values["stamp_jitter_limit"])
        if report.uneven:
            self.get_logger().warning(report.uneven, throttle_duration_sec=30.0)
        self._diagnostics_pub.publish(messages.diagnostics_message(report, name, hardware_id, stamp))

    def _on_set_capture(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        response.success, response.message = True, f"capture is {'on' if request.data else 'off'}"
        try:
            if self.lifecycle_state != "active":
                raise DeviceError("the node is not active; activate it first (ros2 lifecycle set)")
            if request.data:
                self._begin_capture()
            else:
                self._end_capture()
        except (DeviceError, InputError) as error:
            response.success, response.message = False, str(error)
        return response

    @property
    def gave_up(self) -> bool:
        """Whether the node cannot go on by itself; ``failure`` says why."""
        return bool(self.failure)

    def _check_parameters(self, changes: list[Parameter]) -> SetParametersResult:
        new = self._values | {change.name: change.value for change in changes}
        try:
            settings.refuse_sim_time(new.get("use_sim_time", False))
            settings.leds(new)
        except InputError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _apply_parameters(self, changes: list[Parameter]) -> None:
        self._values |= {change.name: change.value for change in changes if change.name in self._values}
        if self._source is not None and any(change.name.startswith("intensity") for change in changes):
            try:
                self._source.set_leds(settings.leds(self._values))
            except DeviceError as error:
                self.get_logger().warning(str(error))


def main(args: list[str] | None = None) -> int:
    """Runs the node until it is told to stop. Exit code 2: unusable input, 1: the sensor never came."""
    try:
        return spin.run(lambda: [DigitDriver()], args)
    except InputError:  # which the node has logged
        return 2


if __name__ == "__main__":
    sys.exit(main())
