"""Domain randomisation: images of the same penetration maps as many different DIGITs would take them.

"My DIGIT is not your DIGIT": gain, light directions, colour mixing, shadows, gel smoothing, blur, noise, JPEG and the
no-contact background differ from sensor to sensor. Each term is one method of `RandomSensor`; around half of the
sensors stay close to TACTO, the others spread over the range of real DIGITs (contrast up to 8 times TACTO's, coloured
shadow lobes, soft halo), and some use a colour table fitted on a real DIGIT. All of these add differences to a
photograph, as TACTO does. Sensors whose model has relative light use the light of `gel_light.py` and the gel of
`rendering/renderer.py`.
"""

from __future__ import annotations

import dataclasses

import cv2
import numpy as np

from midastouch_perception.rendering.renderer import sunk_in
from midastouch_perception.sensor_model import SensorModel

from .gel_light import DESIGNS, DIGIT_DESIGN, GelLight, LampDesign
from .optics import ColourTable, Illumination, gel_normals, shade

_GEL_NOISE = 1.6  # times TACTO's: real cameras turn their gain up


@dataclasses.dataclass(frozen=True)
class RandomisationRange:
    """Range over which sensors vary.

    Attributes: wide_fraction of the sensors that leave TACTO's neighbourhood; table_fraction of those that use
    `colour_table`, if there is one; dark_fraction of the frames in which the object, next to the view, blocks one of
    the lights; design_fraction of the sensors with relative light whose lamps are not a DIGIT's.
    """

    wide_fraction: float = 0.6
    table_fraction: float = 0.35
    dark_fraction: float = 0.12
    design_fraction: float = 0.0
    colour_table: ColourTable | None = None


class RandomSensor:
    """One imaginary DIGIT: its optics and background are fixed; `images` adds the changes from frame to frame.

    Args: sensor, at the resolution of the maps; backgrounds, real no-contact images (B, H, W, 3) uint8 at that
    resolution; rng.
    """

    def __init__(
        self,
        sensor: SensorModel,
        backgrounds: np.ndarray,
        rng: np.random.Generator,
        ranges: RandomisationRange = RandomisationRange(),
    ):
        self.sensor = sensor
        self.wide = bool(rng.random() < ranges.wide_fraction) or sensor.light == "relative"
        self._tangents = sensor.rays
        self._rest_depth = sensor.gel_depth.astype(np.float32)
        self._rest_normals = gel_normals(sensor)
        self._illumination = self._draw_illumination(rng)
        self._mixing = self._draw_mixing(rng)
        self._gain = 0.5 * (np.exp(rng.uniform(np.log(0.7), np.log(8))) if self.wide else rng.uniform(0.8, 1.25))
        self._field = self._smooth_field(rng, 0.35) if self.wide else np.ones((1, 1, 1), np.float32)
        self._shadow = rng.uniform(0, 0.8) if self.wide and rng.random() < 0.5 else 0.0
        self._smoothing = rng.uniform(0.1e-3, 0.8e-3) if self.wide and rng.random() < 0.6 else 0.0
        self._table = None
        if self.wide and ranges.colour_table and rng.random() < ranges.table_fraction:
            self._table = ranges.colour_table
            self._gain = rng.uniform(0.4, 1.5)
            self._smoothing = self._smoothing or 0.1e-3  # the table needs finite slopes, so the gel must be smooth
            self._orientation = int(rng.integers(4)), bool(rng.random() < 0.5)
        self._blur = rng.uniform(0.4, 1.4) if self.wide else 0.7
        self._noise = rng.uniform(0.2, 2.5)
        self._jpeg = int(rng.uniform(60, 97)) if rng.random() < 0.6 else None
        self.background = self._draw_background(backgrounds, rng)
        self._dark_fraction = ranges.dark_fraction
        self._rest = self._render(self._rest_depth, self._rest_normals, self._illumination)
        self._gel = None
        if sensor.light == "relative":
            other = ranges.design_fraction and rng.random() < ranges.design_fraction
            design = LampDesign.random(rng) if other else DESIGNS.get(sensor.lamps, DIGIT_DESIGN)
            self._gel = GelLight(sensor, rng, design)
            self._noise *= _GEL_NOISE
            self._reach, self._outline_fraction = rng.uniform(0.2e-3, 1.2e-3), rng.random() * (rng.random() < 0.8)
            self._stiffness = np.exp(rng.uniform(np.log(0.08e-3), np.log(0.7e-3))) / sensor.pixel_size

    def images(
        self, penetration: np.ndarray, normals: np.ndarray, rng: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return images (N, H, W, 3) and the reference no-contact image (H, W, 3), float32 grey levels 0 ... 255.

        penetration (N, H, W) m and normals (N, H, W, 3), gel frame, come from `PenetrationRenderer`.
        """
        out = np.empty((*penetration.shape, 3), np.float32)
        for i, (depth_map, surface) in enumerate(zip(penetration, normals, strict=True)):
            out[i] = self.image(depth_map, surface, rng, self._drift(rng))
        reference = self._expose(self.background + rng.normal(0, 1.0, 3).astype(np.float32), rng)
        return out, reference

    def image(
        self, penetration: np.ndarray, normals: np.ndarray, rng: np.random.Generator, drift: np.ndarray | float = 1.0
    ) -> np.ndarray:
        """Return the image (H, W, 3) float32 grey levels of one touch, as in `images`.

        drift: factor of the light relative to that of the no-contact image; a number, or (H, W, 3).
        """
        today = self.background * drift
        lit = today * self._lit(penetration) if self._gel else today + self._difference(penetration, normals, rng)
        return self._expose(lit, rng)

    def _lit(self, penetration: np.ndarray) -> np.ndarray:
        """Return the ratio (H, W, 3) of the image to the no-contact image, for relative light."""
        if not penetration.any():
            return np.ones((*penetration.shape, 3), np.float32)
        height = sunk_in(penetration, self.sensor.pixel_size, self._reach, self._outline_fraction)
        height = cv2.GaussianBlur(height, (0, 0), self._stiffness)
        return cv2.GaussianBlur(self._gel.ratio(height), (0, 0), self._blur)

    def _difference(self, penetration: np.ndarray, surface: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        touching = penetration > 0
        if not touching.any():
            return np.zeros((*penetration.shape, 3), np.float32)
        if self._smoothing:
            penetration = self._gel_follows(penetration)
        if self._table:
            coloured = self._table.difference(penetration, self.sensor.pixel_size, *self._orientation)
            change = coloured * (self._gain * self._field)
        else:
            depth = self._rest_depth - penetration
            if self._smoothing:
                shading = gel_normals(self.sensor, depth)
            else:
                shading = np.where(touching[..., None], surface, self._rest_normals)
            image = self._render(depth, shading, self._illumination)
            if rng.random() < self._dark_fraction:
                image = self._darken(image, depth, shading, rng)
            change = (image - self._rest) @ self._mixing * (self._gain * self._field)
        if self._shadow:
            occlusion = self._occlusion(penetration)
            change *= 1 - self._shadow * occlusion
            change -= 12 * self._gain * self._shadow * occlusion * (~touching)[..., None]
        return cv2.GaussianBlur(change, (0, 0), self._blur)

    def _render(self, depth: np.ndarray, normals: np.ndarray, light: Illumination) -> np.ndarray:
        return shade(depth, normals, *self._tangents, light)

    def _darken(
        self, image: np.ndarray, depth: np.ndarray, normals: np.ndarray, rng: np.random.Generator
    ) -> np.ndarray:
        """Return the image without one light in a region with straight outlines, as in the shadow of a wall."""
        light = self._illumination
        on = np.ones((len(light.colours), 1))
        on[rng.integers(len(on))] = 0
        y, x = np.mgrid[-1 : 1 : image.shape[0] * 1j, -1 : 1 : image.shape[1] * 1j]
        region = np.ones(image.shape[:2], bool)
        for angle in rng.uniform(0, 2 * np.pi) + rng.uniform(0, np.pi / 2, int(rng.integers(1, 3))):
            region &= x * np.cos(angle) + y * np.sin(angle) > rng.uniform(-0.3, 0.9)
        dark = self._render(depth, normals, dataclasses.replace(light, colours=light.colours * on))
        return np.where(region[..., None], dark, image)

    def _gel_follows(self, penetration: np.ndarray) -> np.ndarray:
        """Return a gel surface that cannot follow sharp edges: blurred, but unchanged where the contact is deep."""
        width = self._smoothing / self.sensor.pixel_size
        core = penetration > 0.4 * penetration.max()
        smooth = penetration
        for factor in (4.0, 2.0, 1.0):
            smooth = cv2.GaussianBlur(smooth, (0, 0), max(factor * width, 0.3))
            smooth = np.where(core, np.maximum(smooth, penetration), smooth)
        return cv2.GaussianBlur(smooth, (0, 0), max(0.5 * width, 0.3))

    def _occlusion(self, penetration: np.ndarray) -> np.ndarray:
        """Return the fraction (H, W, 3) in [0, 1] of each colour's light that higher gel next to a pixel hides."""
        out = np.empty((*penetration.shape, 3), np.float32)
        for k, position in enumerate(self._illumination.positions[:3]):
            direction = position[:2] / max(np.linalg.norm(position[:2]), 1e-9)
            # the gel that casts a shadow lies towards the light; rows run against y
            reach = 1.5e-3 / self.sensor.pixel_size
            shift = np.array([[1, 0, -direction[0] * reach], [0, 1, direction[1] * reach]], np.float32)
            higher = cv2.warpAffine(penetration, shift, penetration.shape[::-1]) - penetration
            out[..., k] = np.clip(cv2.GaussianBlur(higher, (0, 0), 2.0) / 1e-3, 0, 1)
        return out

    def _draw_illumination(self, rng: np.random.Generator) -> Illumination:
        tacto = Illumination.tacto()
        spread = 3.0 if self.wide else 1.0
        angles = np.radians([150.0, 30.0, 270.0]) + rng.normal(0, np.radians(6) * spread, 3)
        radius = 0.02 + rng.normal(0, 1e-3 * spread, 3)
        height = -0.005 + rng.normal(0, 1e-3 * spread, 3)
        positions = np.stack([radius * np.cos(angles), radius * np.sin(angles), height], axis=1)
        positions += rng.normal(0, 5e-4 * spread, 3)
        intensity = np.clip(1 + rng.normal(0, 0.2 * spread, 3), 0.3, 3)
        light = dataclasses.replace(tacto, positions=positions, colours=tacto.colours * intensity[:, None])
        if not self.wide:
            return light
        cone, base = rng.uniform(0.2, 1), rng.uniform(0.15, 0.6)
        metallic, roughness = rng.uniform(0, 0.5), rng.uniform(0.5, 1)
        return dataclasses.replace(light, cone=cone, base=base, metallic=metallic, roughness=roughness)

    def _draw_mixing(self, rng: np.random.Generator) -> np.ndarray:
        """Draw a colour matrix (3, 3): each LED leaks into the other colours of the camera's filter."""
        leak = rng.uniform(0, 0.35, (3, 3)) if self.wide else rng.uniform(0, 0.05, (3, 3))
        np.fill_diagonal(leak, rng.uniform(0.6, 1.4, 3) if self.wide else 1.0)
        return leak.astype(np.float32)

    def _smooth_field(self, rng: np.random.Generator, amplitude: float) -> np.ndarray:
        """Draw a smooth positive factor (H, W, 3) around 1, for vignetting and uneven illumination."""
        y, x = np.mgrid[-1 : 1 : self.sensor.height * 1j, -1 : 1 : self.sensor.width * 1j].astype(np.float32)
        terms = np.stack([x, y, x * y, x * x - 0.3, y * y - 0.3], axis=-1)
        weights = rng.normal(0, amplitude / 2, (5, 3)).astype(np.float32)
        return np.exp(np.clip(terms @ weights, -1, 1))

    def _draw_background(self, backgrounds: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        real = backgrounds[rng.integers(len(backgrounds))].astype(np.float32)
        if rng.random() < 0.3:  # a procedural one: the mean colour of a real one with a random field
            mean = real.mean(axis=(0, 1)) * rng.uniform(0.7, 1.3, 3)
            return np.clip(mean * self._smooth_field(rng, 0.5), 5, 245).astype(np.float32)
        return np.clip(real * rng.uniform(0.85, 1.15, 3).astype(np.float32), 0, 255)

    def _drift(self, rng: np.random.Generator) -> np.ndarray:
        """Draw the factor (H, W, 3) by which one frame's light differs from that of the stored no-contact image.

        On a real DIGIT presses differ from it by 3-8 grey levels, smoothly over the image and differently each time.
        """
        if not self.wide:
            return np.full((1, 1, 1), 1 + rng.normal(0, 0.01), np.float32)
        even, uneven = rng.normal(0, 0.04, 3).astype(np.float32), 0.1 * (self._smooth_field(rng, 0.8) - 1)
        drift = 1 + np.float32(rng.random()) * (even + uneven)
        return drift * np.float32(np.exp(rng.normal(0, 0.08))) if self._gel else drift

    def _expose(self, image: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        noisy = np.clip(image + self._noise * rng.standard_normal(image.shape, np.float32), 0, 255)
        if self._jpeg is None:
            return noisy.astype(np.float32)
        _, encoded = cv2.imencode(".jpg", noisy.astype(np.uint8), [cv2.IMWRITE_JPEG_QUALITY, self._jpeg])
        return cv2.imdecode(encoded, cv2.IMREAD_COLOR).astype(np.float32)
