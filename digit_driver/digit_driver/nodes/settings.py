"""From parameter values, named as in ``parameters.PARAMETERS``, to the settings of the ROS-free parts."""

from __future__ import annotations

from midastouch_common.errors import InputError

from ..camera_model import CameraModel
from ..frame_source import PORTRAIT_SHAPE, FrameSource
from ..leds import scaled_levels
from ..reader import ReaderTiming
from ..sources import make_source
from ..v4l2_device import V4l2Settings
from .parameters import Value


def leds(values: dict[str, Value]) -> tuple[int, int, int]:
    """LED levels. Raises InputError if they are out of range."""
    return scaled_levels(values["intensity"], list(values["intensity_rgb"]))


def source(values: dict[str, Value]) -> FrameSource:
    """The source that is meant, not yet open. Raises InputError for a combination that does not exist."""
    device = V4l2Settings(
        camera=CameraModel.load(values["camera_model"]),
        serial=values["serial"],
        video_device=values["video_device"],
        resolution=values["resolution"],
        fps=values["fps"],
        leds=leds(values),
        use_buffer_timestamps=values["use_buffer_timestamps"],
    )
    return make_source(device, values["replay_path"], values["replay_fps"], values["replay_loop"])


def image_size(values: dict[str, Value]) -> tuple[int, int]:
    """Width and height of the image that this source gives, pixels."""
    if values["replay_path"]:
        return PORTRAIT_SHAPE[1::-1]
    return CameraModel.load(values["camera_model"]).mode(values["resolution"]).output


def timing(values: dict[str, Value]) -> ReaderTiming:
    """How patient the reader is."""
    return ReaderTiming(
        wait_for_device=values["wait_for_device_timeout"],
        reconnect=values["reconnect_timeout"],
        stall=values["stall_timeout"],
    )


def refuse_sim_time(use_sim_time: bool) -> None:
    """Raises InputError when it is on."""
    if use_sim_time:
        raise InputError(
            "use_sim_time: the driver stamps with the wall clock, which simulated time does not follow; "
            "set it to false here, or play a recording with `midastouch replay`"
        )
