"""Slides seen by measured sensors in place of TACTO's camera: gel, light and exposure as on real DIGITs.

The path is the plain slide's; `MeasuredSensor` makes the images, the sensors in turn. The depth network is that for
real gel. To calibrate a sensor, its presses of a ball go through `midastouch calibrate` first.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from functools import cached_property

import numpy as np

from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_calibration.ball import ball_centre, ball_penetration
from midastouch_perception.sensor_calibration.calibration import SensorCalibration
from midastouch_perception.sensor_calibration.fit import calibrate
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tdn import load_tdn
from midastouch_simulation.measured_optics import MeasuredOptics, MeasuredSensor, measured_sensors
from midastouch_tools.datasets import Sequence

from .cache import Cache, Touches
from .setup import Networks

_BALL_DIAMETER = 6e-3  # m: a bearing's
_PRESSES = 10
_CONTACT = (0.35, 0.65)  # radius, of the ball's: as deep as people pressed the sensors that were measured
_CHUNK = 32  # maps rendered at a time: bounds memory


@dataclasses.dataclass(frozen=True)
class RealSensorCache(Cache):
    """A cache whose slides are seen by measured sensors; calibrated: whether each is calibrated first."""

    calibrated: bool = False

    @cached_property
    def networks(self) -> Networks:
        """Networks, loaded on first use. Raises InputError for a sensor whose light is not that of real gel."""
        networks = Networks.load(self.tdn, self.tcn, self.sensor)
        if networks.sensor.light != "relative":
            raise InputError(
                f"sensor {self.sensor}: its light is a simulator's, not real gel's; use --sensor digit_real"
            )
        return networks

    @cached_property
    def optics(self) -> list[MeasuredOptics]:
        """The measured sensors."""
        return [MeasuredOptics.load(name) for name in measured_sensors()]

    @cached_property
    def calibrations(self) -> list[SensorCalibration]:
        """The calibrations of the measured sensors, made on first use."""
        sensor = self.networks.sensor
        return [calibrate_measured(optics, sensor, np.random.default_rng(k)) for k, optics in enumerate(self.optics)]

    def describe(self) -> dict[str, str]:
        optics = " ".join(f"{optics.name}-{optics.content_id}" for optics in self.optics)
        return super().describe() | {"optics": optics, "calibrated": str(self.calibrated)}

    @property
    def _touches(self) -> str:
        return "touches_calibrated" if self.calibrated else "touches_uncalibrated"

    def _perceive(self, mesh: ObjectMesh, sequence: Sequence, number: int) -> Touches:
        return Touches.of_images(*self._seen(mesh, sequence, number))

    def _seen(self, mesh: ObjectMesh, sequence: Sequence, number: int) -> tuple[list[np.ndarray], np.ndarray, Networks]:
        """Return the images of a slide, the no-contact image, all (H, W, 3) uint8 RGB, and the networks for them."""
        which, sensor = number % len(self.optics), self.networks.sensor
        camera = MeasuredSensor(self.optics[which], sensor, np.random.default_rng(number))
        calibration = self.calibrations[which] if self.calibrated else None
        networks = dataclasses.replace(self.networks, tdn=load_tdn(self.tdn, sensor, calibration=calibration))
        renderer = PenetrationRenderer(mesh, sensor.for_maps)
        images: list[np.ndarray] = []
        for start in range(0, sequence.n_frames, _CHUNK):
            images += camera.images(renderer.render(sequence.poses_true[start : start + _CHUNK]))
        return images, camera.background, networks


def within_gel(depths: np.ndarray) -> np.ndarray:
    """Return the penetration (N, H, W) m of objects: their depths in the untouched gel, 0 where they are negative."""
    return np.maximum(depths, 0)


def calibrate_measured(
    optics: MeasuredOptics,
    sensor: SensorModel,
    rng: np.random.Generator,
    gel: Callable[[np.ndarray], np.ndarray] = within_gel,
) -> SensorCalibration:
    """Calibrate a sensor as a person would, by ten presses of a ball spread over the gel.

    gel: turns depths of objects, like `within_gel`, into the heights that the optics see. Raises InputError as
    `calibrate`.
    """
    camera = MeasuredSensor(optics, sensor, rng)
    heights = gel(np.stack(_ball_presses(sensor.for_maps, rng)))
    images = {f"press_{i:02d}": image for i, image in enumerate(camera.images(heights))}
    return calibrate(images, camera.background, _BALL_DIAMETER, sensor, diameter_is_right=True).calibration


def _ball_presses(sensor: SensorModel, rng: np.random.Generator) -> list[np.ndarray]:
    """Return the penetrations (H, W) m of a ball in cells of a grid, as a careful hand spreads them."""
    radius, columns = 0.5 * _BALL_DIAMETER, 2
    rows, out = _PRESSES // columns, []
    for cell in rng.permutation(_PRESSES):
        u = (0.2 + 0.6 * (cell % columns + rng.random()) / columns) * sensor.width
        v = (0.15 + 0.7 * (cell // columns + rng.random()) / rows) * sensor.height
        centre = ball_centre(u, v, rng.uniform(*_CONTACT) * radius, radius, sensor)
        out.append(ball_penetration(centre, radius, sensor))
    return out
