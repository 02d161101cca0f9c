"""The driver's parameters as one table, and how a node declares such a table."""

from __future__ import annotations

import difflib
from dataclasses import dataclass

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.node import Node

from midastouch_common.errors import InputError

Value = bool | int | float | str | list[int]


@dataclass(frozen=True)
class Parameter:
    """One parameter. ``limits`` are inclusive; ``run_time`` ones may be set while the node runs."""

    name: str
    default: Value
    description: str
    limits: tuple[float, float] | None = None
    choices: tuple[Value, ...] = ()
    run_time: bool = False

    def descriptor(self) -> ParameterDescriptor:
        """What ``ros2 param describe`` shows."""
        descriptor = ParameterDescriptor(description=self.description, read_only=not self.run_time)
        if self.choices:
            descriptor.additional_constraints = f"one of {', '.join(map(str, self.choices))}"
        if self.limits:
            low, high = self.limits
            if isinstance(self.default, float):
                descriptor.floating_point_range = [FloatingPointRange(from_value=low, to_value=high)]
            else:
                descriptor.integer_range = [IntegerRange(from_value=int(low), to_value=int(high))]
        return descriptor


_DAY_S = 86400.0
_SECOND_NS = 1_000_000_000

PARAMETERS = (
    Parameter("camera_model", "digit", "kind of sensor: digit, gelsight_mini, or a YAML file of your own"),
    Parameter("serial", "", "serial number of the sensor, e.g. D20123; empty: the only one plugged in"),
    Parameter("video_device", "", "device node to open instead of searching by serial, e.g. /dev/video2"),
    Parameter("replay_path", "", "play this image folder, YCB-Slide sequence or video instead of a sensor"),
    Parameter("replay_fps", 0.0, "frames per second of the replay; 0: the recording's own", (0.0, 1000.0)),
    Parameter("replay_loop", True, "begin the replay again at its end"),
    Parameter("resolution", "", "mode of the camera model; empty: its first. A DIGIT's: QVGA (240x320), VGA (480x640)"),
    Parameter("fps", 0, "frames per second; 0: the mode's first. A DIGIT's: 60, 30 at QVGA, 30, 15 at VGA", (0, 240)),
    Parameter("intensity", 15, "overall brightness of the LEDs", (0, 15), run_time=True),
    Parameter("intensity_rgb", [15, 15, 15], "red, green, blue LED at full intensity, 0...15", run_time=True),
    Parameter("frame_id", "digit_optical_frame", "frame of the images: z forward, x right, y down (REP 103)"),
    Parameter("camera_name", "digit", "name of the camera in log messages"),
    Parameter("camera_info_url", "", "calibration YAML, file:///... or a path; empty: uncalibrated"),
    Parameter("wait_for_device_timeout", -1.0, "patience at start, s; negative: endless", (-1.0, _DAY_S)),
    Parameter("reconnect_timeout", 1.0, "pause between attempts to find the sensor (again), s", (0.1, 60.0)),
    Parameter("stall_timeout", 1.0, "open the sensor anew after so long without a good frame, s", (0.2, 60.0)),
    Parameter("use_buffer_timestamps", True, "stamp with the kernel's acquisition time, not that of reading"),
    Parameter("timestamp_offset", 0, "added to every stamp, ns", (-_SECOND_NS, _SECOND_NS), run_time=True),
    Parameter("stamp_jitter_limit", 0.005, "warn of stamps less even than this, s", (1e-4, 1.0), run_time=True),
    Parameter("jpeg_quality", 95, "quality of the compressed images", (1, 100), run_time=True),
    Parameter("diagnostics_period", 1.0, "time between diagnostics, s", (0.1, 60.0)),
    Parameter("autostart", True, "configure and activate at start, without a lifecycle manager"),
)


def declare(node: Node, parameters: tuple[Parameter, ...]) -> dict[str, Value]:
    """Declares all of them and returns their values by name.

    Raises:
        InputError: a given value has the wrong type or is not allowed.
    """
    values = {}
    for parameter in parameters:
        descriptor = parameter.descriptor()
        try:
            value = node.declare_parameter(parameter.name, parameter.default, descriptor).value
        except InvalidParameterTypeException as error:
            hint = "; write e.g. 1.0 instead of 1" if isinstance(parameter.default, float) else ""
            raise InputError(f"{parameter.name}: {error}{hint}") from error
        except InvalidParameterValueException as error:
            raise InputError(f"{parameter.name}: {error}") from error
        if parameter.choices and value not in parameter.choices:
            raise InputError(f"{parameter.name}: must be {descriptor.additional_constraints}, got {value}")
        values[parameter.name] = list(value) if isinstance(parameter.default, list) else value
    return values


def refuse_unknown(node: Node) -> None:
    """Call after everything is declared.

    Raises:
        InputError: a parameter file or the command line gives a parameter that the node does not have.
    """
    # rclpy offers no public way to ask which overrides were given but never declared.
    unknown = sorted(name for name in node._parameter_overrides if not node.has_parameter(name))
    if unknown:
        similar = difflib.get_close_matches(unknown[0], node._parameters, n=1)
        hint = f"did you mean {similar[0]}?" if similar else "`ros2 param list` shows those it has"
        raise InputError(f"{node.get_fully_qualified_name()} has no parameter {', '.join(unknown)}; {hint}")
