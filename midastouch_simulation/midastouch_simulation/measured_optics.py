"""Optics measured on one real sensor: response of its images to the shape of its gel, fitted to presses of a ball.

The light is relative, as in `gel_light.py`, but measured: each colour's ratio to the no-contact image is a polynomial
in the gel's normal, with factors quadratic in the position, plus the effect of higher gel on six sides (shadow lobes).
Beyond the steepest slope of the presses, and outside of their region, colours are those at the limit.
These optics are used to judge networks, not to train them.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Iterator
from functools import cached_property, lru_cache
from pathlib import Path

import cv2
import numpy as np

from midastouch_common.errors import InputError
from midastouch_common.files import atomic_path, require_file
from midastouch_perception.arrays import finite_array
from midastouch_perception.rendering.renderer import GelShape
from midastouch_perception.sensor_calibration.response import height_slopes, position_terms
from midastouch_perception.sensor_model import SensorModel

_FOLDER = Path(__file__).parent / "measured_sensors"
_NORMAL_TERMS = 7
_DIRECTIONS = np.arange(6) * np.pi / 3
_SIDE_STEPS = np.array([0.5, 1.0, 2.0]) * 1e-3  # m, distances at which higher gel is looked for
SIDE_TERMS = len(_DIRECTIONS) * len(_SIDE_STEPS)
_FRAME_CORRELATION = 0.95  # of exposure and drift, between consecutive frames
_FORMAT = 1
_SHAPE_KEYS = "reach", "share", "blur"  # of the file, in the order of GelShape's fields


@dataclasses.dataclass(frozen=True, eq=False)
class MeasuredOptics:
    """Optics of one measured sensor.

    Attributes: name; source, the command that made it; shape of the gel; steepest, sine of the largest slope seen;
    region (4,), left, right, top and bottom of the presses, as fractions of the image; normal (7, 6, 3), factors of the
    terms of normal and position in each colour; sides (18, 3), factors of the terms of higher gel around a pixel;
    background (16, 12, 3) grey levels; exposure (3,), standard deviation of each colour's log-brightness between
    frames; drift (6,), standard deviation of the terms of position in a frame's light; noise of a pixel at the map's
    resolution, grey levels; explained, fraction (0 ... 1) of the change in presses left out of the fit.
    """

    name: str
    source: str
    shape: GelShape
    steepest: float
    region: np.ndarray
    normal: np.ndarray
    sides: np.ndarray
    background: np.ndarray
    exposure: np.ndarray
    drift: np.ndarray
    noise: float
    explained: float

    @classmethod
    def load(cls, name_or_path: str | Path) -> MeasuredOptics:
        """Load optics by a name of `measured_sensors`, or from a file that `save` wrote; InputError for others."""
        path = _FOLDER / f"{name_or_path}.json"
        path = path if path.is_file() else require_file(name_or_path, "measured sensor")
        try:
            data = json.loads(path.read_text())
            if data.pop("format") != _FORMAT:
                raise ValueError("another format")
            arrays = {
                name: finite_array(data.pop(name), shape)
                for name, shape in (
                    ("region", (4,)),
                    ("normal", (_NORMAL_TERMS, 6, 3)),
                    ("sides", (SIDE_TERMS, 3)),
                    ("background", (16, 12, 3)),
                    ("exposure", (3,)),
                    ("drift", (6,)),
                )
            }
            numbers = {name: float(finite_array(data.pop(name), ())) for name in ("steepest", "noise", "explained")}
            shape = data.pop("shape")
            if set(shape) != set(_SHAPE_KEYS):
                raise ValueError(f"shape of {', '.join(shape)}")
            gel = GelShape(*(float(finite_array(shape[name], ())) for name in _SHAPE_KEYS))
            return cls(shape=gel, **numbers, **arrays, **data)  # type: ignore[arg-type] # wrong names raise
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise InputError(
                f"{path}: not a measured sensor ({error}); make one: "
                "midastouch calibrate DIR --ball-diameter 0.006 --optics FILE"
            ) from error

    def save(self, path: str | Path) -> None:
        """Write the sensor as JSON."""
        with atomic_path(path) as temporary:
            temporary.write_text(self._text() + "\n")

    @cached_property
    def content_id(self) -> str:
        """Short hash of all values."""
        return hashlib.sha256(self._text().encode()).hexdigest()[:12]

    def _text(self) -> str:
        shape = dict(zip(_SHAPE_KEYS, dataclasses.astuple(self.shape), strict=True))
        values = {f.name: getattr(self, f.name) for f in dataclasses.fields(self)} | {"shape": shape}
        return json.dumps({"format": _FORMAT} | values, default=lambda a: np.round(np.asarray(a, float), 4).tolist())

    def ratio(self, penetration: np.ndarray, pixel: float) -> np.ndarray:
        """Return the ratio (H, W, 3) float32 of image to no-contact image for a penetration map (H, W) m; pixel, m."""
        height = self.shape.height(penetration, pixel)
        out = side_terms(height, pixel, self.steepest) @ self.sides.astype(np.float32) + 1
        out += (normal_terms(height, pixel, self.steepest)[..., None, :] @ _factors(self, *height.shape))[..., 0, :]
        return np.maximum(out, 0)


@lru_cache(maxsize=4)
def _factors(optics: MeasuredOptics, height: int, width: int) -> np.ndarray:
    """Return the factors (H, W, 7, 3) float32 of the normal's terms in each colour at every pixel."""
    return np.tensordot(positions_within(optics.region, height, width), optics.normal.astype(np.float32), (2, 1))


def measured_sensors() -> list[str]:
    """Return the names of the shipped measured sensors."""
    return sorted(path.stem for path in _FOLDER.glob("*.json"))


def positions_within(region: np.ndarray, height: int, width: int) -> np.ndarray:
    """Return terms (H, W, 6) float32 of each pixel's nearest position in a region (`MeasuredOptics.region`)."""
    left, right, top, bottom = region * np.array([width, width, height, height])
    rows = np.clip(np.arange(height), top, bottom).astype(int).clip(0, height - 1)
    columns = np.clip(np.arange(width), left, right).astype(int).clip(0, width - 1)
    return position_terms(height, width)[rows][:, columns]


def normal_terms(height: np.ndarray, pixel: float, steepest: float) -> np.ndarray:
    """Return terms (H, W, 7) float32 of the normal of gel of a height (H, W) m; pixel, m; steepest, largest sine."""
    slopes = height_slopes(height, pixel)
    tangent = np.hypot(slopes[..., 0], slopes[..., 1])
    sine = np.minimum(tangent / np.sqrt(1 + tangent**2), np.float32(steepest))
    x, y = np.moveaxis(slopes * (sine / np.maximum(tangent, np.float32(1e-6)))[..., None], -1, 0)
    square = x * x + y * y
    return np.stack([x, y, x * x - y * y, 2 * x * y, square, square * x, square * y], axis=-1)


def side_terms(height: np.ndarray, pixel: float, steepest: float) -> np.ndarray:
    """Return terms (H, W, 18) float32: the slope up from a pixel to gel in six directions at three distances."""
    terms, limit = [], np.float32(steepest / np.sqrt(1 - steepest**2))
    for step in _SIDE_STEPS:
        for angle in _DIRECTIONS:
            shift = np.array([[1, 0, np.cos(angle) * step / pixel], [0, 1, np.sin(angle) * step / pixel]], np.float32)
            there = cv2.warpAffine(height, shift, height.shape[::-1], borderMode=cv2.BORDER_REPLICATE)
            terms.append(np.clip((there - height) / np.float32(step), 0, limit))
    return np.stack(terms, axis=-1)


class MeasuredSensor:
    """Stream of images of a measured sensor, whose light and exposure vary continuously from frame to frame.

    Args: optics; sensor, geometry at full size; rng. Attributes: background (H, W, 3) uint8.
    """

    def __init__(self, optics: MeasuredOptics, sensor: SensorModel, rng: np.random.Generator):
        self._optics, self._small, self._rng = optics, sensor.for_maps, rng
        size = self._small.width, self._small.height
        self._rest = cv2.resize(optics.background.astype(np.float32), size, interpolation=cv2.INTER_CUBIC)
        self._positions = position_terms(*size[::-1])
        self._light = self._draw()
        self.background = self._exposed(self._rest)

    def images(self, penetrations: np.ndarray) -> Iterator[np.ndarray]:
        """Yield images (H, W, 3) uint8 RGB of penetration maps (N, H / 2, W / 2) m, one frame per map."""
        for penetration in penetrations:
            fresh = zip(self._light, self._draw(), strict=True)
            self._light = [_FRAME_CORRELATION * old + np.sqrt(1 - _FRAME_CORRELATION**2) * new for old, new in fresh]
            exposure, drift = self._light
            today = ((1 + self._positions @ drift)[..., None] * np.exp(exposure)).astype(np.float32)
            yield self._exposed(self._rest * today * self._optics.ratio(penetration, self._small.pixel_size))

    def _draw(self) -> list[np.ndarray]:
        rng, optics = self._rng, self._optics
        return [rng.standard_normal(3) * optics.exposure, rng.standard_normal(6) * optics.drift]

    def _exposed(self, light: np.ndarray) -> np.ndarray:
        noisy = light + self._optics.noise * self._rng.standard_normal(light.shape, np.float32)
        # networks use the mean of four pixels, so the four are equal here
        return np.clip(np.rint(noisy), 0, 255).astype(np.uint8).repeat(2, axis=0).repeat(2, axis=1)
