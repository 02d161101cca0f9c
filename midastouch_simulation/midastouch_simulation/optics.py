"""Optics of a DIGIT's camera image of the gel, as in two simulators: light, material and image formation.

`TactoOptics` computes the image of the TACTO simulator for a DIGIT in closed form: three coloured spot lights on a
rough, slightly metallic gel, gamma, and half the difference to the undeformed gel added to a real no-contact image.
`ColourTable` is the optics that Taxim fitted on a real DIGIT. `randomisation.py` varies both far beyond that.
"""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import cv2
import numpy as np

import midastouch_kernels as kernels
from midastouch_common.errors import InputError
from midastouch_common.files import readable, require_file
from midastouch_perception.sensor_model import SensorModel

_MOST_CHANGE = 130.0  # grey levels; the quadratics overshoot at positions without a press in the fit


@dataclasses.dataclass(frozen=True)
class Illumination:
    """Spot lights and gel material in the camera frame (x right, y up, looking along -z), metres.

    Attributes: positions (L, 3) m; colours (L, 3), linear RGB radiance at 1 m; cone, cosine falloff of the spots:
    1 as in TACTO (60 deg), 0 for lights that shine everywhere; base, reflectance; metallic; roughness.
    """

    positions: np.ndarray
    colours: np.ndarray
    cone: float = 1.0
    base: float = 0.3
    metallic: float = 0.2
    roughness: float = 0.8

    @classmethod
    def tacto(cls) -> Illumination:
        """Return the `digit_shadow` configuration that the paper uses: green, red and blue on a 20 mm ring."""
        angles = np.radians([150.0, 30.0, 270.0])
        positions = np.stack([0.02 * np.cos(angles), 0.02 * np.sin(angles), np.full(3, -0.005)], axis=1)
        # intensity 2 divided by 255, because TACTO passes its colours as integers
        return cls(positions, np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, 1]]) * (2 / 255))


class TactoOptics:
    """TACTO's optics for one sensor model: images of penetration maps at the model's resolution."""

    def __init__(self, sensor: SensorModel):
        self.sensor = sensor
        self._illumination = Illumination.tacto()
        # TACTO's 7 x 7 Gaussian has 1.4 px at 240 x 320
        self._blur = 1.4 * sensor.height / 320
        self._rest = render_gel(np.zeros((sensor.height, sensor.width), np.float32), None, sensor, self._illumination)

    def difference(self, penetration: np.ndarray, normals: np.ndarray | None = None) -> np.ndarray:
        """Return the change (H, W, 3) float32, grey levels, of the image by a contact of `penetration` (H, W) m.

        normals (H, W, 3): of the touching surface, gel frame, 0 outside (`render_with_normals`); if None, they come
        from the slopes of the penetration map.
        """
        if normals is None:
            change = render_gel(penetration, None, self.sensor, self._illumination) - self._rest
        else:
            # only touched pixels change, a small part of the image
            touched = np.flatnonzero(penetration > 0)
            gel_depth, *tangent = (a.ravel()[None, touched] for a in (self.sensor.gel_depth, *self.sensor.rays))
            depth = gel_depth - penetration.ravel()[touched]
            pressed = shade(depth, normals.reshape(-1, 3)[None, touched], tangent[0], tangent[1], self._illumination)[0]
            change = np.zeros_like(self._rest)
            change.reshape(-1, 3)[touched] = pressed - self._rest.reshape(-1, 3)[touched]
        return cv2.GaussianBlur(0.5 * change, (0, 0), self._blur)

    def image(
        self,
        penetration: np.ndarray,
        background: np.ndarray,
        rng: np.random.Generator,
        normals: np.ndarray | None = None,
        noise: float = 2.0,
    ) -> np.ndarray:
        """Return the camera image (H, W, 3) uint8 RGB over a no-contact image `background` (H, W, 3) uint8.

        noise: standard deviation in grey levels of the pixel noise.
        """
        clean = np.clip(self.difference(penetration, normals) + background, 0, 255)
        noisy = np.floor(clean) + noise * rng.standard_normal(clean.shape, np.float32)
        return np.clip(noisy, 0, 255).astype(np.uint8)


def gel_normals(sensor: SensorModel, depth: np.ndarray | None = None) -> np.ndarray:
    """Return unit normals (H, W, 3) float32, gel frame, of a depth map (H, W) m; of the undeformed gel by default."""
    depth = sensor.gel_depth if depth is None else depth
    tangent_x, tangent_y = sensor.rays
    points = np.stack([tangent_x * depth, tangent_y * depth, -depth], axis=-1).astype(np.float32)
    along_u = np.gradient(points, axis=1)
    along_v = np.gradient(points, axis=0)
    normals = np.cross(along_v, along_u)
    return normals / np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-20)


def render_gel(
    penetration: np.ndarray, normals: np.ndarray | None, sensor: SensorModel, illumination: Illumination
) -> np.ndarray:
    """Render the gel (H, W, 3) float32, grey levels 0 ... 255, before blur, background and noise."""
    depth = (sensor.gel_depth - penetration).astype(np.float32)
    if normals is None:
        shading = gel_normals(sensor, depth)
    else:
        rest = gel_normals(sensor)
        shading = np.where((penetration > 0)[..., None], normals, rest).astype(np.float32)
    tangent_x, tangent_y = sensor.rays
    return shade(depth, shading, tangent_x, tangent_y, illumination)


def shade(
    depth: np.ndarray, normals: np.ndarray, tangent_x: np.ndarray, tangent_y: np.ndarray, light: Illumination
) -> np.ndarray:
    """Shade a surface: (H, W, 3) float32 grey levels for depth (H, W) m and normals (H, W, 3), gel frame."""
    c_diffuse = light.base * 0.96 * (1 - light.metallic)
    f0 = 0.04 + (light.base - 0.04) * light.metallic
    maps = (np.ascontiguousarray(each, np.float32) for each in (depth, normals, tangent_x, tangent_y))
    lights = light.positions.astype(np.float32), light.colours.astype(np.float32)
    return kernels.shade(*maps, *lights, light.cone, c_diffuse / math.pi, f0, light.roughness)


class ColourTable:
    """Table from slopes of the gel to changes of colour, at any resolution of the portrait image.

    Args: coefficients (S, D, 6, 3): per slope bin (0 ... 90 deg), direction bin (-180 ... 180 deg) and channel the
    factors of x^2, y^2, xy, x, y, 1 in pixels of a 640 x 480 image.
    """

    def __init__(self, coefficients: np.ndarray):
        if coefficients.ndim != 4 or coefficients.shape[2:] != (6, 3) or not np.isfinite(coefficients).all():
            raise InputError(f"colour table: shape {coefficients.shape}, need finite (slopes, directions, 6, 3)")
        # the fit leaves an offset on flat gel, which a difference image cannot have
        flat = coefficients[0].mean(axis=0)
        self._coefficients = np.ascontiguousarray(coefficients - flat, np.float32)

    @classmethod
    def load(cls, path: str | Path) -> ColourTable:
        """Load Taxim's `polycalib.npz` (arrays grad_r, grad_g, grad_b). Raises InputError if it is not one."""
        path = require_file(path, "colour table")
        checked = readable(path, "not a Taxim colour table", "give its polycalib.npz")
        with checked, np.load(path, allow_pickle=False) as file:
            return cls(np.stack([file[f"grad_{c}"] for c in "rgb"], axis=-1))

    def difference(self, height: np.ndarray, pixel: float, quarter_turns: int = 0, mirrored: bool = False):
        """Return the change (H, W, 3) float32, grey levels, of the image by a gel surface raised by `height` (H, W) m.

        pixel: m per pixel. quarter_turns, mirrored: motion from the table's camera image to this portrait image; the
        table's own orientation (one quarter turn) is not documented with it.
        """
        down, right = np.gradient(np.ascontiguousarray(height, np.float32), np.float32(pixel))
        out = kernels.look_up_colours(self._coefficients, down, right, quarter_turns % 4, mirrored)
        return np.clip(out, -_MOST_CHANGE, _MOST_CHANGE, out=out)
