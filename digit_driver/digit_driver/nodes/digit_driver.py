"""The ``digit_driver`` node: a DIGIT (or a recording of one) as a ROS 2 camera."""

from __future__ import annotations

import sys

from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from std_msgs.msg import Header
from std_srvs.srv import SetBool

from midastouch_common.errors import InputError
from midastouch_common.ros.lifecycle import RobustLifecycleNode
from midastouch_common.ros.spin import spin_nodes

from ..camera_info import Calibration, load_calibration
from ..errors import DeviceError
from ..frame_slot import ReaderState, ReaderStatus
from ..frame_source import FrameSource
from ..reader import FrameReader
from . import messages, settings
from .image_publisher import ImagePublisher
from .parameters import PARAMETERS, declare, refuse_unknown
from .stream_report import StreamReport

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
        self._images = ImagePublisher(self)
        self._report = StreamReport(self, self._values)
        self._wake = self.create_guard_condition(self._on_reader_event)
        # steady: a wall clock that is set back would silence a timer of its own for as long
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(self._values["diagnostics_period"], lambda: self._report.publish(self._status), clock=steady)
        self.create_service(SetBool, "set_capture", self._on_set_capture)
        self.add_on_set_parameters_callback(self._check_parameters)
        self.add_post_set_parameters_callback(self._apply_parameters)

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        values = self._values
        try:
            self._source = settings.source(values)
            self._calibration = load_calibration(values["camera_info_url"], settings.image_size(values))
        except Exception as error:  # rclpy swallows what is raised, and its reason
            return self.give_up(str(error) if isinstance(error, InputError) else f"{type(error).__name__}: {error}")
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
        self._report.begin()
        self._reader.start()
        self._reader.wait_settled(_FIRST_OPEN_S)
        status = self._status
        if status.state is ReaderState.FAILED:
            self._reader.stop()
            raise InputError(status.last_error)
        self._report.tell(status)

    def _end_capture(self) -> None:
        if self._reader is not None and not self._reader.stop():
            self.get_logger().error("the device driver hangs in the kernel; leaving it behind")

    @property
    def _status(self) -> ReaderStatus:
        return self._reader.status() if self._reader is not None else ReaderStatus()

    def _on_reader_event(self) -> None:
        if self._reader is None:
            return
        self._report.tell(self._status)
        frame = self._reader.take()
        if frame is not None:
            stamp = messages.time_message(self._report.stamp(frame) + self._values["timestamp_offset"])
            header = Header(stamp=stamp, frame_id=self._values["frame_id"])
            self._images.publish(frame.image, header, self._calibration, self._values["jpeg_quality"])

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
        return spin_nodes(lambda: [DigitDriver()], args)
    except InputError:  # which the node has logged
        return 2


if __name__ == "__main__":
    sys.exit(main())
