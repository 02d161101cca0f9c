"""Calibration of one sensor's colours, and the depth network's input for a calibrated sensor.

A calibrated sensor's slopes are known in metres per metre. The network's input shows them as the colours of a standard
sensor: three lamps, 120 degrees apart, each colour proportional to the slope towards its lamp. The network was also
trained on such images. It can distinguish them from images of an uncalibrated sensor, because their colours cancel.
"""

from __future__ import annotations

import dataclasses
import zipfile
from collections.abc import Mapping
from functools import cached_property, lru_cache
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from midastouch_common.errors import InputError
from midastouch_common.files import atomic_path, readable, require_file

from ..arrays import finite_array
from ..gel_texture import CLEAR, gel_texture, likeness
from ..sensor_model import SensorModel, given_as
from .response import ColourResponse

_ANGLES = np.radians([30.0, 150.0, 270.0])  # directions of the red, green and blue lamp; y up
# rows: change of the colours by a slope to the right and one downwards; gel that falls towards a lamp is brighter
_STANDARD = -100.0 * np.stack([np.cos(_ANGLES), -np.sin(_ANGLES)]).astype(np.float32)
_BACK = np.linalg.pinv(_STANDARD).astype(np.float32)
_FORMAT = 4
_WITHOUT_FUSION = 3  # the format before: as this one, and joined as by default
_DEFAULTS = Path(__file__).parent / "defaults"
_GRID = (16, 12)  # rows, columns
_MOST_GROWTH = 10  # px
NETWORK_WEIGHT = 0.51
"""Weight of the network's slopes in the joined ones, with the least variance on measured sensors and training objects
(`midastouch_benchmark/fits/slope_weight.py`), unless presses say otherwise."""
OUTLINE_GROWTH = 1
"""Pixels by which a contact is wider than the network's, unless presses say otherwise."""
_OTHER_SCALE = 0.02  # fraction by which the pixels' size may differ
_OTHER_GEL = 0.1  # fraction by which three quarters of a no-contact image may differ, apart from its brightness


def standard_colours(slopes: np.ndarray) -> np.ndarray:
    """Return the change (..., 3) float32 grey levels of a standard sensor by slopes (..., 2), to the right and down."""
    return np.asarray(slopes, np.float32) @ _STANDARD


def plain_slopes(change: np.ndarray) -> np.ndarray:
    """Return the slopes (..., 2) float32 that cause changes (..., 3) grey levels of a standard sensor."""
    return np.asarray(change, np.float32) @ _BACK


def background_colours(background: np.ndarray) -> np.ndarray:
    """Return mean colours (16, 12, 3) float32 over blocks of a no-contact image (H, W, 3), which differ from those of
    another gel or light."""
    return cv2.resize(background.astype(np.float32), _GRID[::-1], interpolation=cv2.INTER_AREA)


def scale_problem(sensor: SensorModel, pixel_size: float) -> str:
    """Return the reason why a calibration is of another scale than a sensor model; empty if it is not.

    Parameters
    ----------
    sensor
        Full size.
    pixel_size : [m], of the calibration
    """
    if abs(pixel_size / sensor.pixel_size - 1) <= _OTHER_SCALE:
        return ""
    return (
        f"the calibration's scale is {1e-3 / pixel_size:.2f} px/mm, that of the sensor model {sensor.name} "
        f"{1e-3 / sensor.pixel_size:.2f}; write a sensor model of your own, a copy of its YAML file with focal "
        f"{sensor.gel_distance / pixel_size:.1f}, and give it to midastouch calibrate as --sensor, without "
        "--px-per-mm, and to all nodes as sensor_model"
    )


class Fusion(NamedTuple):
    """How slopes are joined: weight, of the network's slopes (0 ... 1); growth, pixels of a map (160 rows) by which a
    contact is wider than the network's."""

    weight: float
    growth: int


@dataclasses.dataclass(frozen=True, eq=False)
class SensorCalibration:
    """Response of one sensor, as found by `midastouch calibrate`.

    Attributes: serial, of the sensor, empty if it was not given; ball_diameter [m]; sensor, name of the sensor model;
    pixel_size [m] at which it was made; coefficients (12, 6, 2), from changes in colour to the gel's slopes
    (`response.py`); background (16, 12, 3), no-contact colours; presses, number of those used; date, ISO 8601; texture
    (H, W) int8 of the gel; texture_sigmas, likeness of that texture in the presses; network_weight, outline_growth, as
    in `Fusion`.
    """

    serial: str
    ball_diameter: float
    sensor: str
    pixel_size: float
    coefficients: np.ndarray
    background: np.ndarray
    presses: int
    date: str
    texture: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros((0, 0), np.int8))
    texture_sigmas: float = 0.0
    network_weight: float = NETWORK_WEIGHT
    outline_growth: int = OUTLINE_GROWTH

    @property
    def fusion(self) -> Fusion:
        """The way in which its slopes are joined with the network's."""
        return Fusion(self.network_weight, self.outline_growth)

    @cached_property
    def response(self) -> ColourResponse:
        """Fitted polynomial."""
        return ColourResponse(self.coefficients)

    @property
    def touched(self) -> str:
        """Description of the presses that it was made from."""
        return f"{self.presses} presses of a ball of {1e3 * self.ball_diameter:g} mm"

    def standardised(self, change: np.ndarray) -> np.ndarray:
        """Return the change (H, W, 3) that a standard sensor would show when this one shows `change` (H, W, 3)."""
        return standard_colours(self.response.slopes(change))

    def check_kind(self, sensor: SensorModel, serial: str = "") -> None:
        """Raise InputError as `check_sensor` does, but accept any scale of the model."""
        if serial and self.serial != serial:
            raise InputError(f"calibration of the sensor '{self.serial}', not of '{serial}'; calibrate this one")
        if self.sensor != sensor.name:
            raise InputError(
                f"calibration for the sensor model {self.sensor}, not for {sensor.name}; start all nodes with "
                f"sensor_model {given_as(self.sensor)}, or calibrate with --sensor {given_as(sensor.name)}"
            )

    def check_sensor(self, sensor: SensorModel, serial: str = "") -> None:
        """Raise InputError if it is not of the sensor with this model (full size) and serial number ("": any)."""
        self.check_kind(sensor, serial)
        if problem := scale_problem(sensor, self.pixel_size):
            raise InputError(problem)

    def background_problem(self, background: np.ndarray) -> str:
        """Return the reason why a no-contact image (H, W, 3) must be of another gel or sensor; empty if there is none.

        A gel without a clear texture is recognised only by its colours.
        """
        again = "press the ball again and run midastouch calibrate"
        texture = gel_texture(background)
        if self.texture_sigmas >= CLEAR and not (
            texture.shape == self.texture.shape and likeness(self.texture, texture).same
        ):
            return (
                f"the calibration of {self.date} was made with another gel (whose fine texture the no-contact image "
                f"does not have); {again}"
            )
        ratio = (background_colours(background) + 1) / (self.background + 1)
        ratio /= np.median(ratio, axis=(0, 1))
        if (off := float(np.quantile(np.abs(ratio - 1), 0.75))) <= _OTHER_GEL:
            return ""
        return (
            f"the calibration of {self.date} was made with another gel or another sensor (the no-contact image differs "
            f"by {100 * off:.0f} %); {again}"
        )

    def save(self, path: str | Path) -> None:
        """Write the calibration; InputError if it cannot be written."""
        values = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        try:
            with atomic_path(path) as temporary, temporary.open("wb") as stream:
                np.savez_compressed(stream, format=_FORMAT, **values)
        except OSError as error:
            raise InputError(f"{path}: {error.strerror or error}; the calibration was not kept") from error

    @classmethod
    def default(cls, sensor: SensorModel) -> SensorCalibration | None:
        """Return the calibration for a kind of lamps, for sensors without one of their own; None if there is none.

        It was made with one sensor of that kind. It relates colours to slopes, so it holds at any scale.
        """
        path = _DEFAULTS / f"{sensor.lamps}.npz"
        return _kept(path) if path.is_file() else None

    @classmethod
    def load(cls, path: str | Path) -> SensorCalibration:
        """Read a calibration. Raises InputError if there is none or it is not one."""
        require_file(path, "calibration")
        fix = "make it again from its presses with midastouch calibrate, or remove it to continue without"
        with readable(path, "not a calibration", fix):
            if not zipfile.is_zipfile(path):
                raise ValueError("no NPZ file")
            with np.load(path, allow_pickle=False) as file:
                if int(file["format"]) not in (_WITHOUT_FUSION, _FORMAT):
                    raise ValueError(f"of format {int(file['format'])}, that of this version is {_FORMAT}")
                return cls(
                    serial=str(file["serial"]),
                    ball_diameter=_positive(file, "ball_diameter"),
                    sensor=str(file["sensor"]),
                    pixel_size=_positive(file, "pixel_size"),
                    coefficients=finite_array(file["coefficients"], (12, 6, 2)),
                    background=_colours(file["background"]),
                    presses=int(_positive(file, "presses")),
                    date=str(file["date"]),
                    texture=_texture(file["texture"]),
                    texture_sigmas=float(finite_array(file["texture_sigmas"], ())),
                    **(_fusion(file) if int(file["format"]) == _FORMAT else {}),
                )


@lru_cache
def _kept(path: Path) -> SensorCalibration:
    return SensorCalibration.load(path)


def _fusion(file: Mapping) -> dict:
    weight, growth = float(file["network_weight"]), int(file["outline_growth"])
    if not (0 <= weight <= 1 and 0 <= growth <= _MOST_GROWTH):
        raise ValueError(f"network_weight {weight:g}, outline_growth {growth}")
    return {"network_weight": weight, "outline_growth": growth}


def _positive(file: Mapping, name: str) -> float:
    value = float(file[name])
    if not 0 < value < np.inf:
        raise ValueError(f"{name} {value:g}")
    return value


def _colours(values: np.ndarray) -> np.ndarray:
    colours = finite_array(values, (*_GRID, 3))
    if colours.min() < 0:
        raise ValueError("negative colours")
    return colours


def _texture(values: np.ndarray) -> np.ndarray:
    if values.ndim != 2 or values.dtype != np.int8:
        raise ValueError(f"texture of shape {values.shape}, type {values.dtype}")
    return values
