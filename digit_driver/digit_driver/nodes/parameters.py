"""Parameters of the driver as one table, and the settings of the ROS-free parts that follow from them."""

from __future__ import annotations

from midastouch_common.message_arrays import SECOND
from midastouch_common.names import require_name
from midastouch_common.ros.managed_node import AUTOSTART
from midastouch_common.ros.parameters import Parameter, Parameters

from ..camera_model import CameraModel
from ..reader import ReaderTiming
from ..v4l2_device import MAX_LED_LEVEL, V4l2Settings

_DAY_S = 86400.0

PARAMETERS = (
    Parameter("camera_model", "digit", "Kind of sensor: digit, gelsight_mini, or a YAML file of your own"),
    Parameter("serial", "", "Serial number of the sensor, e.g. D20123; empty: the only one plugged in"),
    Parameter(
        "video_device",
        "",
        "Device node to open, e.g. /dev/video2; if it is of another sensor than `serial`, that one is opened",
    ),
    Parameter("resolution", "", "Mode of the camera model; empty: its first. A DIGIT's: QVGA (240x320), VGA (480x640)"),
    Parameter(
        "fps",
        0,
        "Frames per second; 0: the mode's first. A DIGIT's: 60, 30 at QVGA, 30, 15 at VGA",
        minimum=0,
        maximum=240,
    ),
    Parameter(
        "intensity", MAX_LED_LEVEL, "Overall brightness of the LEDs", minimum=0, maximum=MAX_LED_LEVEL, read_only=False
    ),
    Parameter(
        "intensity_rgb",
        [MAX_LED_LEVEL] * 3,
        "Red, green, blue LED at full intensity",
        minimum=0,
        maximum=MAX_LED_LEVEL,
        read_only=False,
    ),
    Parameter("frame_id", "digit_optical_frame", "Frame of the images: z forward, x right, y down (REP 103)"),
    Parameter("camera_name", "digit", "Name of the camera in log messages"),
    Parameter("camera_info_url", "", "Camera info as YAML, file:///... or a path; empty: uncalibrated"),
    Parameter(
        "wait_for_device_timeout",
        -1.0,
        "How long the sensor may take to appear at the start; negative: for ever",
        "s",
        minimum=-1.0,
        maximum=_DAY_S,
    ),
    Parameter(
        "reconnect_timeout", 1.0, "Pause between attempts to find the sensor (again)", "s", minimum=0.1, maximum=60.0
    ),
    Parameter(
        "stall_timeout",
        1.0,
        "Open the sensor again after this time without a good frame",
        "s",
        minimum=0.2,
        maximum=60.0,
    ),
    Parameter("use_buffer_timestamps", True, "Stamp with the kernel's acquisition time, not that of reading"),
    Parameter("timestamp_offset", 0, "Added to every stamp", "ns", minimum=-SECOND, maximum=SECOND, read_only=False),
    Parameter(
        "stamp_jitter_limit",
        0.005,
        "Warn of stamps less even than this",
        "s",
        minimum=1e-4,
        maximum=1.0,
        read_only=False,
    ),
    Parameter("jpeg_quality", 95, "Quality of the compressed images", minimum=1, maximum=100, read_only=False),
    Parameter("diagnostics_period", 1.0, "Time between diagnostics", "s", minimum=0.1, maximum=60.0, at_start=True),
    AUTOSTART,
)


def led_levels(parameters: Parameters) -> tuple[int, int, int]:
    """Return the brightness of the red, green and blue LED, 0...15."""
    red, green, blue = (round(level * parameters["intensity"] / MAX_LED_LEVEL) for level in parameters["intensity_rgb"])
    return red, green, blue


def camera_settings(parameters: Parameters) -> V4l2Settings:
    """Return the settings of the sensor. Raises InputError for an unknown camera model, a mode that it lacks, and a
    serial number that can be none."""
    return V4l2Settings(
        camera=CameraModel.load(parameters["camera_model"]),
        serial=parameters["serial"] and require_name("serial number", parameters["serial"], "serial"),
        video_device=parameters["video_device"],
        resolution=parameters["resolution"],
        fps=parameters["fps"],
        leds=led_levels(parameters),
        use_buffer_timestamps=parameters["use_buffer_timestamps"],
    )


def reader_timing(parameters: Parameters) -> ReaderTiming:
    """Return the times of the reader."""
    return ReaderTiming(
        wait_for_device=parameters["wait_for_device_timeout"],
        reconnect=parameters["reconnect_timeout"],
        stall=parameters["stall_timeout"],
    )
