"""The ``digit_driver`` node: a tactile camera as a ROS 2 camera."""

from __future__ import annotations

import sys
from collections.abc import Callable

from rcl_interfaces.msg import SetParametersResult
from rclpy.parameter import Parameter
from std_msgs.msg import Header
from std_srvs.srv import SetBool

from midastouch_common.errors import InputError
from midastouch_common.ros import spin
from midastouch_common.ros.conversions import stamp_from_ns
from midastouch_common.ros.managed_node import INACTIVE, ManagedNode
from midastouch_common.ros.services import offer

from ..camera_info import Intrinsics, load_intrinsics
from ..frames import DeviceError, ReaderState, ReaderStatus
from ..reader import FrameReader
from ..stream_health import StreamMonitor
from ..v4l2_device import V4l2Camera, V4l2Settings
from .image_publisher import ImagePublisher
from .parameters import PARAMETERS, camera_settings, led_levels, reader_timing

_FIRST_OPEN_S = 5.0
_SIM_TIME = (
    "use_sim_time: the driver stamps with the wall clock, which simulated time does not follow; "
    "set it to false here, or play a recording with `midastouch replay`"
)


class DigitDriver(ManagedNode):
    """Node that publishes ``image_raw``, ``image_raw/compressed``, ``camera_info``, diagnostics; has ``set_capture``.

    Configuring checks the settings, activating opens the camera; ``autostart`` does both on construction.

    Args:
        make_camera: makes the camera of its settings; tests give one on a fake kernel.
        node_options: passed on to rclpy's node, e.g. ``parameter_overrides``, ``namespace``, ``context``.

    Attributes:
        gave_up: whether the node cannot continue on its own, because the camera never came; ``failure`` is the reason.

    Raises:
        InputError: a parameter cannot be used or, with ``autostart``, the camera that it names.
    """

    def __init__(self, make_camera: Callable[[V4l2Settings], V4l2Camera] = V4l2Camera, **node_options) -> None:
        super().__init__("digit_driver", PARAMETERS, **node_options)
        self.gave_up = False
        self._make_camera = make_camera
        self._camera: V4l2Camera | None = None
        self._reader: FrameReader | None = None
        self._intrinsics: Intrinsics | None = None
        self._monitor = StreamMonitor()
        self._logged = ReaderStatus()
        self.diagnostics.set_period(self.parameters["diagnostics_period"])
        self._images = ImagePublisher(self)
        self._wake = self.create_guard_condition(self._on_reader_event)
        offer(self, SetBool, "set_capture", self._on_set_capture)
        self.add_on_set_parameters_callback(self._refuse_sim_time)
        self.add_post_set_parameters_callback(self._set_leds)
        self.autostart()

    def configure(self) -> None:
        """Check the settings and make the reader."""
        if self.get_parameter("use_sim_time").value:
            raise InputError(_SIM_TIME)
        settings = camera_settings(self.parameters)
        self._intrinsics = load_intrinsics(self.parameters["camera_info_url"], settings.mode.output)
        self._camera = self._make_camera(settings)
        self._reader = FrameReader(self._camera, self._wake.trigger, reader_timing(self.parameters))
        self.diagnostics.hardware_id = settings.serial
        if self.get_namespace() == "/":
            self.get_logger().info(
                "in the global namespace, which does for one sensor; several need one each: namespace:=digit_left with "
                "midastouch run or ros2 launch, --ros-args -r __ns:=/digit_left with ros2 run"
            )

    def connect(self) -> None:
        """Open the camera, or start to wait for it."""
        try:
            self._begin_capture()
        except DeviceError as error:
            raise InputError(str(error)) from error

    def disconnect(self) -> None:
        """Close the camera."""
        if not self._reader.stop():
            self.get_logger().error("the device driver hangs in the kernel; leaving it behind")

    def unload(self) -> None:
        """Drop camera and reader."""
        self._reader = self._camera = None

    def describe(self) -> tuple[bytes, str, dict]:
        """Return the verdict on the stream: level, message and values for the diagnostics."""
        report = self._monitor.report(self._reader.status(), self.parameters["stamp_jitter_limit"])
        if report.uneven:
            self.get_logger().warning(report.uneven, throttle_duration_sec=30.0)
        return bytes([report.level]), report.message, report.values

    def _begin_capture(self) -> None:
        """Begin to capture; raises DeviceError or InputError if it is known at once that the camera cannot work."""
        self._logged = ReaderStatus()
        self._reader.start()
        self._reader.wait_settled(_FIRST_OPEN_S)
        status = self._reader.status()
        if status.state is ReaderState.FAILED:
            self._reader.stop()
            raise InputError(status.last_error)
        self._log_changes(status)

    def _on_reader_event(self) -> None:
        if self._reader is None:
            return
        # first: the status is then no older than the frame, and names the camera that it is from
        frame = self._reader.take()
        self._log_changes(self._reader.status())
        if frame is not None:
            stamp = stamp_from_ns(self._monitor.stamp(frame) + self.parameters["timestamp_offset"])
            if self._monitor.frozen:
                return  # the image is old: an arm must not act on it
            header = Header(stamp=stamp, frame_id=self.parameters["frame_id"])
            self._images.publish(frame.image, header, self._intrinsics, self.parameters["jpeg_quality"])

    def _log_changes(self, status: ReaderStatus) -> None:
        """Log, once, what has happened to the camera since the last call; give up if it has failed for good."""
        log = self.get_logger()
        before, self._logged = self._logged, status
        if status.info is not None and (before.info is None or status.reconnects != before.reconnects):
            self._monitor.opened(status.info)
            self.diagnostics.hardware_id = status.info.serial or status.info.name
            log.info(f"{self.parameters['camera_name']}: {status.info}")
            for warning in status.info.warnings:
                log.warning(warning)
        if (status.state, status.last_error) == (before.state, before.last_error):
            return
        if status.state is ReaderState.FAILED:
            self.failure, self.gave_up = status.last_error, True
            log.error(status.last_error)
        elif status.last_error != before.last_error:
            log.warning(f"{status.state.value}: {status.last_error}", throttle_duration_sec=5.0)

    def _on_set_capture(self, request: SetBool.Request) -> str:
        if not self.active:
            raise InputError(INACTIVE)
        try:
            self._begin_capture() if request.data else self.disconnect()
        except DeviceError as error:
            raise InputError(str(error)) from error
        return f"capture is {'on' if request.data else 'off'}"

    def _refuse_sim_time(self, changes: list[Parameter]) -> SetParametersResult:
        refused = any(change.name == "use_sim_time" and change.value for change in changes)
        return SetParametersResult(successful=not refused, reason=_SIM_TIME if refused else "")

    def _set_leds(self, changes: list[Parameter]) -> None:
        if self._camera is not None and any(change.name.startswith("intensity") for change in changes):
            try:
                self._camera.set_leds(led_levels(self.parameters))
            except DeviceError as error:
                self.get_logger().warning(str(error))


def main(args: list[str] | None = None) -> int:
    """Run the node until a signal stops it. Exit code 2: unusable input, 1: the sensor never came."""
    return spin.run(lambda: [DigitDriver()], args)


if __name__ == "__main__":
    sys.exit(main())
