"""One kind of tactile camera as data: its USB identity, its modes, and the way from its image to the published one.

Any USB camera that the kernel's driver for UVC supports can be one: write a YAML file like those in `cameras/`.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import yaml

from midastouch_common.errors import InputError
from midastouch_common.files import expanded, require_file
from midastouch_common.images import REDUCTIONS, BrokenImageError, decode_image

from .frames import CorruptFrameError
from .videodev2 import PIX_FMT_MJPEG, PIX_FMT_YUYV

_FOLDER = Path(__file__).parent / "cameras"
_FIX = f"compare with {_FOLDER / 'digit.yaml'}"
_FORMATS = {"YUYV": PIX_FMT_YUYV, "MJPG": PIX_FMT_MJPEG}
_ROTATIONS = {0: None, 90: cv2.ROTATE_90_COUNTERCLOCKWISE, 180: cv2.ROTATE_180, 270: cv2.ROTATE_90_CLOCKWISE}
_REDUCTION_FLAGS = {1: cv2.IMREAD_COLOR, **{factor: flag for flag, factor in REDUCTIONS.items()}}
_KEYS = {"label", "usb_ids", "product", "rotation", "leds", "modes"}
_ASPECT_TOLERANCE = 0.02  # by which a pixel's sides may differ: the sensor model has the same scale for both
_MODE_KEYS = {"width", "height", "fps", "format", "crop", "output"}


@dataclass(frozen=True)
class CameraMode:
    """One resolution of a camera.

    Attributes:
        width, height: of the camera's image, pixels.
        fps: frame rates, the default first.
        pixel_format: requested, ``PIX_FMT_YUYV`` or ``PIX_FMT_MJPEG``; the other one is used if the camera insists.
        crop: column, row, width, height of the part that is used, pixels of the camera's image.
        output: width and height of the published image, pixels: the part that is used, turned and scaled.
    """

    width: int
    height: int
    fps: tuple[int, ...]
    pixel_format: int
    crop: tuple[int, int, int, int]
    output: tuple[int, int]

    @property
    def reduction(self) -> int:
        """Factor (1, 2, 4, 8) by which a JPEG may be reduced in decoding, without loss in the published image."""
        across = min(self.crop[2:]) / min(self.output), max(self.crop[2:]) / max(self.output)
        return max(factor for factor in (1, 2, 4, 8) if factor == 1 or factor <= min(across))


@dataclass(frozen=True)
class CameraModel:
    """One kind of tactile camera.

    Attributes:
        label: name of such a sensor in messages.
        usb_ids: (vendor, product) of its USB device, four hexadecimal digits each.
        product: beginning of the USB device's product name; empty if ``usb_ids`` identify the camera.
        rotation: degrees counter-clockwise from the camera's image to the published one.
        leds: whether their brightness is set as on a DIGIT.
        modes: by name, the default first.
    """

    label: str
    usb_ids: tuple[tuple[str, str], ...]
    product: str
    rotation: int
    leds: bool
    modes: dict[str, CameraMode]

    @classmethod
    def load(cls, name_or_path: str | Path) -> CameraModel:
        """Load a camera model.

        Parameters
        ----------
        name_or_path
            A shipped model (`digit`, `gelsight_mini`), or a YAML file of the same form.

        Raises
        ------
        InputError
            There is no such model, or a line of the file, which is named, is missing or wrong.
        """
        path = _FOLDER / f"{name_or_path}.yaml"
        if not path.is_file():
            path = expanded(name_or_path, "camera_model")
            if path.suffix != ".yaml":
                known = ", ".join(sorted(p.stem for p in _FOLDER.glob("*.yaml")))
                raise InputError(f"camera_model: {name_or_path} is not known; use {known} or the path of a .yaml file")
        require_file(path, "camera model")
        try:
            content = yaml.safe_load(path.read_text(encoding="utf-8"))
            return _parsed(content)
        except KeyError as error:
            raise InputError(f"camera_model: {path} has no {error.args[0]}; {_FIX}") from error
        except (OSError, UnicodeDecodeError, yaml.YAMLError, TypeError, ValueError, AttributeError) as error:
            raise InputError(f"camera_model: {path}: {error}; {_FIX}") from error

    @property
    def usb(self) -> str:
        """Identity on USB, for messages."""
        ids = ", ".join(":".join(pair) for pair in self.usb_ids)
        return " or ".join(filter(None, (ids and f"id {ids}", self.product and f"name '{self.product} ...'")))

    def mode(self, name: str) -> CameraMode:
        """Return the mode of that name, the default for an empty one. Raises InputError if there is none."""
        name = name or next(iter(self.modes))
        if name not in self.modes:
            raise InputError(f"resolution: a {self.label} has {', '.join(self.modes)}, got {name!r}")
        return self.modes[name]

    def upright(self, image: np.ndarray, mode: CameraMode) -> np.ndarray:
        """Crop, turn and scale an image of the camera.

        Parameters
        ----------
        image : (H, W, 3) uint8, which may be reduced
        mode

        Returns
        -------
        (height, width, 3) uint8, to publish
        """
        scale = image.shape[1] / mode.width
        column, row, width, height = (round(value * scale) for value in mode.crop)
        part = image[row : row + height, column : column + width]
        turn = _ROTATIONS[self.rotation]
        turned = part if turn is None else cv2.rotate(part, turn)
        if turned.shape[1::-1] == mode.output:
            return np.ascontiguousarray(turned)
        return cv2.resize(turned, mode.output, interpolation=cv2.INTER_AREA)


def decode(data: bytes, pixel_format: int, width: int, height: int, reduction: int = 1) -> np.ndarray:
    """Decode one buffer.

    Parameters
    ----------
    data
        The used part of the buffer.
    pixel_format
        `PIX_FMT_YUYV` or `PIX_FMT_MJPEG`.
    width, height : size of the camera's image [pixels]
    reduction
        1, 2, 4 or 8: divides a JPEG's sides, which are rounded up. A large one is decoded several times faster at an
        eighth of its size.

    Returns
    -------
    (height, width, 3) uint8 RGB

    Raises
    ------
    CorruptFrameError
        The buffer does not hold one whole image.
    ValueError
        Another pixel format.
    """
    if pixel_format == PIX_FMT_YUYV:
        if len(data) != 2 * width * height:
            raise CorruptFrameError(f"{len(data)} bytes instead of {2 * width * height}")
        packed = np.frombuffer(data, np.uint8).reshape(height, width, 2)
        return cv2.cvtColor(packed, cv2.COLOR_YUV2RGB_YUYV)
    if pixel_format == PIX_FMT_MJPEG:
        try:
            image = decode_image(data, _REDUCTION_FLAGS[reduction])
        except BrokenImageError as error:
            raise CorruptFrameError(str(error)) from error
        if image.shape != (-(-height // reduction), -(-width // reduction), 3):
            raise CorruptFrameError(f"JPEG of {len(data)} bytes is not a {width}x{height} image")
        return cv2.cvtColor(image, cv2.COLOR_BGR2RGB)
    raise ValueError(f"pixel format {pixel_format:#x}")


def _parsed(content: dict) -> CameraModel:
    _refuse_others(content, _KEYS)
    rotation = content.get("rotation", 0)
    if rotation not in _ROTATIONS:
        raise ValueError(f"rotation must be one of {', '.join(map(str, _ROTATIONS))} degrees, got {rotation}")
    ids = tuple(_usb_id(text) for text in _list(content.get("usb_ids") or [], "usb_ids"))
    product = str(content.get("product") or "")
    if not ids and not product:
        raise ValueError("neither usb_ids nor product: nothing distinguishes the sensor from other cameras")
    modes = {str(name): _mode(mode, rotation) for name, mode in content["modes"].items()}
    if not modes:
        raise ValueError("modes is empty")
    leds = content.get("leds", False)
    if not isinstance(leds, bool):
        raise ValueError(f"leds: {leds!r} is neither true nor false")
    return CameraModel(str(content["label"]), ids, product, rotation, leds, modes)


def _usb_id(text: str) -> tuple[str, str]:
    found = re.fullmatch(r"([0-9a-fA-F]{4}):([0-9a-fA-F]{4})", str(text))
    if not found:
        raise ValueError(f"usb_ids: '{text}' is not vendor:product in hexadecimal digits, in quotes")
    return found[1].lower(), found[2].lower()


def _mode(values: dict, rotation: int) -> CameraMode:
    _refuse_others(values, _MODE_KEYS)
    width, height = _whole(values["width"], "width"), _whole(values["height"], "height")
    rates = tuple(_whole(rate, "fps") for rate in _list(values["fps"], "fps"))
    if not rates:
        raise ValueError("fps is empty")
    kind = values.get("format", "YUYV")
    if kind not in _FORMATS:
        raise ValueError(f"format must be one of {', '.join(_FORMATS)}, got {kind}")
    crop = tuple(_whole(value, "crop", 0) for value in _list(values.get("crop", [0, 0, width, height]), "crop"))
    if len(crop) != 4:
        raise ValueError(f"crop {list(crop)} is not a column, a row, a width and a height")
    column, row, wide, high = crop
    if min(column, row) < 0 or min(wide, high) < 1 or column + wide > width or row + high > height:
        raise ValueError(f"crop {list(crop)} (column, row, width, height) leaves the image of {width}x{height}")
    turned = (high, wide) if rotation in (90, 270) else (wide, high)
    output = tuple(_whole(value, "output") for value in _list(values.get("output", [*turned]), "output"))
    if len(output) != 2:
        raise ValueError(f"output {list(output)} is not a width and a height")
    if abs(output[0] * turned[1] / (output[1] * turned[0]) - 1) > _ASPECT_TOLERANCE:
        raise ValueError(
            f"output {list(output)} is of another shape than the crop, turned {turned[0]} x {turned[1]}: a pixel must "
            "stay square; change crop or output"
        )
    return CameraMode(width, height, rates, _FORMATS[kind], crop, output)


def _list(value: object, name: str) -> list:
    if not isinstance(value, list):
        raise ValueError(f"{name}: {value!r} is not a list; write [{value}]")
    return value


def _whole(value: object, name: str, least: int = 1) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or value < least:
        raise ValueError(f"{name}: {value!r} is not a whole number of at least {least}")
    return value


def _refuse_others(values: dict, known: set[str]) -> None:
    if other := sorted(set(values) - known):
        raise ValueError(f"unknown: {', '.join(other)}; there are {', '.join(sorted(known))}")
