"""Light on real gel: the fraction by which each colour of the image changes where the gel slopes.

Divided by the no-contact image, presses look alike on every DIGIT measured so far and all over the image, though the
grey levels differ several times: brightness of lamps, vignetting and exposure cancel. Geometry remains. For light that
arrives at an angle, brightness grows with the slope towards it (Lambert), its part of a colour can only fall to 0, and
higher gel takes it from the gel behind.

But the light is not the same all over the image. Lamps are close to the gel, so that their light comes from other
directions and is weaker at the far end, and lens and gel make patterns in it. On both real sensors that were measured,
the response to one direction of slope is five times weaker at one position than at another, and a calibration explains
no more than 82 and 88 % of the slopes of presses it was not fitted to. A good part of the sensors here are like that.
"""

from __future__ import annotations

import dataclasses

import cv2
import numpy as np

from midastouch_perception.sensor_model import SensorModel

_COLOURS = 3
_LAMP_ANGLE_SIGMA = np.radians(25)  # deviation of a lamp from its angle in the design
_MOST_LAMPS = 5
_LAMP_DISTANCE = 0.008, 0.05  # m of the lights from the middle
_LAMP_HEIGHT = 0.004  # m of the lights over the gel
_MOST_FADING = 3.0  # largest power of the distance with which a light fades
_PATTERN_SHAPE = 12, 9  # rows and columns of the pattern that each light's lens and the gel make
_MOST_PATTERN_SIGMA = 0.6  # largest standard deviation of its logarithm
_LAMP_SOFTNESS = 0.4  # because lamps are not points
_SHADOW_STEPS = (
    np.array([0.25, 0.5, 0.9, 1.4, 2.0, 2.8]) * 1e-3
)  # m towards a light, distances at which higher gel may block it
_PENUMBRA = 0.15e-3, 0.25  # m of height between full shadow and none, and its increase per metre of distance


@dataclasses.dataclass(frozen=True, eq=False)
class LampDesign:
    """Lamps of a kind of sensor: angles (L,) rad, y up; colours (L,), index of each lamp's colour out of three."""

    angles: np.ndarray
    colours: np.ndarray

    @classmethod
    def random(cls, rng: np.random.Generator) -> LampDesign:
        """Draw three to five lamps evenly around the gel, turned by any angle and with any order of colours."""
        lamps = int(rng.integers(_COLOURS, _MOST_LAMPS + 1))
        angles = rng.uniform(0, 2 * np.pi) + np.arange(lamps) * 2 * np.pi / lamps
        return cls(angles, np.resize(rng.permutation(_COLOURS), lamps))


DIGIT_DESIGN = LampDesign(np.radians([30.0, 150.0, 270.0]), np.arange(_COLOURS))
DESIGNS = {"gelsight_mini": LampDesign(np.radians([180.0, 90.0, 0.0]), np.arange(_COLOURS))}
"""Designs that are not a DIGIT's, by `SensorModel.lamps`. A Mini's is that to which its calibration answers."""


class GelLight:
    """Lights of one imaginary sensor of relative light, a DIGIT or of another `design`, for one sensor model at its
    resolution."""

    def __init__(self, sensor: SensorModel, rng: np.random.Generator, design: LampDesign = DIGIT_DESIGN):
        self._pixel = sensor.pixel_size
        shape = sensor.height, sensor.width
        self._grid = np.mgrid[-1 : 1 : shape[0] * 1j, -1 : 1 : shape[1] * 1j].astype(np.float32)
        self._positions = np.stack([t * sensor.gel_depth for t in sensor.rays]).astype(np.float32)
        lights = len(design.angles)
        self._angles = design.angles + rng.normal(0, _LAMP_ANGLE_SIGMA, lights)
        fading, patchy = rng.uniform(0, _MOST_FADING), rng.uniform(0, _MOST_PATTERN_SIGMA)
        lamps = [self._draw_lamp(angle, fading, patchy, rng) for angle in self._angles]
        self._towards, brightness = zip(*lamps, strict=True)
        overall = np.log(3.6) + rng.normal(0, 0.35)
        # single precision here and below, because most of the time of a simulated image is spent on these
        incidence = [np.exp(overall + rng.normal(0, 0.15) + self._smooth(rng, 0.25)) for _ in range(lights)]
        self._incidence = np.array(incidence, np.float32)
        # fraction (H, W) of each colour (first) that comes from each light (second); the rest is diffuse
        self._fractions = np.empty((_COLOURS, lights, *shape), np.float32)
        for colour in range(_COLOURS):
            own, leaked = rng.uniform(0.4, 0.85), rng.uniform(0, 0.25, lights)
            leaked[design.colours == colour] = own
            parts = zip(leaked, brightness, strict=True)
            self._fractions[colour] = [part * bright * np.exp(self._smooth(rng, 0.3)) for part, bright in parts]
        diffuse = rng.uniform(0.0, 0.5)
        self._fractions /= np.maximum(self._fractions.sum(axis=1, keepdims=True) + diffuse, 1)
        self._shadow = np.array(rng.uniform(0, 1, lights) * (rng.random() < 0.8), np.float32)
        self._elevation = rng.uniform(0.02, 0.6, lights)  # tangent of the lights' height, which shortens shadows
        # limit of each light's brightening
        self._brightest = np.array(np.exp(rng.uniform(np.log(1.5), np.log(8), lights)), np.float32)
        self._power = rng.uniform(0.85, 1.3)  # of the camera: gamma

    def ratio(self, height: np.ndarray) -> np.ndarray:
        """Return the ratio (H, W, 3) float32 of image to no-contact image for gel raised by `height` (H, W) m."""
        right = cv2.Sobel(height, cv2.CV_32F, 1, 0) / (8 * self._pixel)
        up = cv2.Sobel(height, cv2.CV_32F, 0, 1) / (-8 * self._pixel)
        foreshortening = 1 / np.sqrt(1 + right**2 + up**2)
        out = np.ones((_COLOURS, *height.shape), np.float32)
        for light in range(len(self._angles)):
            across = right * self._towards[light][0] + up * self._towards[light][1]
            lit = foreshortening * _falling_to_nothing(1 - self._incidence[light] * across)
            brighter = np.maximum(lit - 1, 0)
            lit += self._brightest[light] * (1 - np.exp(-brighter / self._brightest[light])) - brighter
            if self._shadow[light]:
                lit *= 1 - self._shadow[light] * self._shadowed(height, light)
            lit -= 1
            for colour in range(_COLOURS):
                out[colour] += self._fractions[colour, light] * lit
        return cv2.merge(list(cv2.pow(np.maximum(out, 0.02), self._power)))

    def _draw_lamp(
        self, angle: float, fading: float, patchy: float, rng: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray]:
        """Draw the direction (2, H, W), right and up, to a lamp at an angle [rad], and its brightness (H, W).

        fading: power of the distance; patchy: standard deviation of the logarithm of its pattern.
        """
        away = np.exp(rng.uniform(*np.log(_LAMP_DISTANCE)))
        lamp = away * np.array([np.cos(angle), np.sin(angle)], np.float32)
        direction = lamp[:, None, None] - self._positions
        distance = np.sqrt((direction**2).sum(axis=0) + _LAMP_HEIGHT**2)
        turned = _turned(direction / distance, self._smooth(rng, 0.3))
        drawn = rng.normal(0, patchy, _PATTERN_SHAPE).astype(np.float32)
        pattern = cv2.resize(drawn, distance.shape[::-1], interpolation=cv2.INTER_CUBIC)
        return turned, (np.hypot(away, _LAMP_HEIGHT) / distance) ** fading * np.exp(pattern)

    def _shadowed(self, height: np.ndarray, light: int) -> np.ndarray:
        """Return the fraction (H, W) in [0, 1] of the light that higher gel hides from a pixel."""
        angle, shadow = self._angles[light], np.zeros_like(height)
        for step in _SHADOW_STEPS:
            # rows run against y
            shift = np.array(
                [[1, 0, -np.cos(angle) * step / self._pixel], [0, 1, np.sin(angle) * step / self._pixel]], np.float32
            )
            towards = cv2.warpAffine(height, shift, height.shape[::-1], borderMode=cv2.BORDER_REPLICATE)
            softness = _PENUMBRA[0] + _PENUMBRA[1] * step
            too_low = -step * self._elevation[light] / softness
            shadow = cv2.max(shadow, cv2.addWeighted(towards, 1 / softness, height, -1 / softness, too_low))
        return cv2.GaussianBlur(np.minimum(shadow, 1), (0, 0), _PENUMBRA[0] / self._pixel)

    def _smooth(self, rng: np.random.Generator, amplitude: float) -> np.ndarray:
        y, x = self._grid
        terms = np.stack([x, y, x * y, x * x - 0.3, y * y - 0.3])
        return np.tensordot(rng.normal(0, amplitude, 5).astype(np.float32), terms, 1)


def _falling_to_nothing(lit: np.ndarray) -> np.ndarray:
    """Return brightness that falls smoothly to 0 for negative values; 1 stays 1."""
    return 0.5 * (lit + np.sqrt(lit**2 + _LAMP_SOFTNESS)) / np.float32(0.5 * (1 + np.sqrt(1 + _LAMP_SOFTNESS)))


def _turned(direction: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Return directions (2, H, W) in the image plane, turned by angles (H, W) rad."""
    cos, sin = np.cos(angle), np.sin(angle)
    return np.stack([cos * direction[0] - sin * direction[1], sin * direction[0] + cos * direction[1]])
