"""Intrinsics of a camera, in the YAML format that ROS camera tools write."""

from __future__ import annotations

import math
from dataclasses import dataclass
from urllib.parse import unquote, urlparse

import yaml

from midastouch_common.errors import InputError
from midastouch_common.files import expanded

_MATRICES = {"camera_matrix": 9, "rectification_matrix": 9, "projection_matrix": 12}


@dataclass(frozen=True)
class Intrinsics:
    """Intrinsics of the portrait image, named as in sensor_msgs/CameraInfo.

    Attributes:
        width, height: pixels.
        distortion_model: e.g. ``plumb_bob``; empty when uncalibrated.
        d: distortion coefficients.
        k: (9,) row-major; k[0] == 0 means uncalibrated.
        r: (9,) row-major.
        p: (12,) row-major.
    """

    width: int
    height: int
    distortion_model: str = ""
    d: tuple[float, ...] = ()
    k: tuple[float, ...] = (0.0,) * 9
    r: tuple[float, ...] = (0.0,) * 9
    p: tuple[float, ...] = (0.0,) * 12


def load_intrinsics(url: str, size: tuple[int, int]) -> Intrinsics:
    """Read intrinsics from a file.

    Parameters
    ----------
    url
        ``file:///path/to.yaml`` or a plain path; empty means uncalibrated.
    size : width and height [pixels] of the images that they must be for

    Raises
    ------
    InputError
        The file cannot be read, is not camera info, or is for images of another size.
    """
    if not url:
        return Intrinsics(*size)
    intrinsics = _read(url)
    if (intrinsics.width, intrinsics.height) != size:
        raise InputError(
            f"camera_info_url: {url} is for {intrinsics.width}x{intrinsics.height} images, "
            f"the driver gives {size[0]}x{size[1]}; calibrate at this resolution"
        )
    return intrinsics


def _read(url: str) -> Intrinsics:
    parsed = urlparse(url)
    if parsed.scheme not in ("", "file"):
        raise InputError(f"camera_info_url: {url}: only file:// URLs and plain paths can be read")
    path = expanded(unquote(parsed.path), "camera_info_url")
    try:
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise InputError(f"camera_info_url: {path} cannot be read: {error}") from error
    try:
        k, r, p = (_numbers(content[name]["data"], count) for name, count in _MATRICES.items())
        return Intrinsics(
            width=int(content["image_width"]),
            height=int(content["image_height"]),
            distortion_model=str(content["distortion_model"]),
            d=_numbers(content["distortion_coefficients"]["data"]),
            k=k,
            r=r,
            p=p,
        )
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise InputError(
            f"camera_info_url: {path} is not camera info ({error!r}); "
            "write it with camera_calibration or camera_info_manager"
        ) from error


def _numbers(values: list, count: int | None = None) -> tuple[float, ...]:
    numbers = tuple(float(value) for value in values)
    if count is not None and len(numbers) != count:
        raise ValueError(f"{len(numbers)} numbers instead of {count}")
    if not all(map(math.isfinite, numbers)):
        raise ValueError("numbers that are not finite")
    return numbers
