"""Effect of soft gel on penetration maps, depth, poses and codes, which were made for gel that sinks in by a rule.

Touches at known poses and presses of known depth are seen by measured sensors: the optics are those of real gel, its
shape is that of an elastic layer. For comparison, the same is done on gel that sinks in by the rule that was fitted to
the sensor's presses, which every other evaluation simulates.
"""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Iterator

import numpy as np

from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core.alignment import PenetrationAlignment
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.noise_model import NoiseModel
from midastouch_perception.contact import Contact
from midastouch_perception.pipeline import DepthStage
from midastouch_perception.rendering.contact_poses import ContactSampling, sample_contact_poses
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_calibration.ball import ball_penetration
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tcn import AnyCodeNet, load_tcn
from midastouch_perception.tdn import load_tdn
from midastouch_simulation.measured_optics import MeasuredOptics, MeasuredSensor, measured_sensors
from midastouch_simulation.soft_gel import ElasticLayer
from midastouch_simulation.solids import Layer, rectangle, stacked
from midastouch_tools.progress import progress_bar

from ..single_touch.matches import best_matches, single_touch_errors
from ..trials.object_sets import chosen_meshes
from ..trials.real_sensor import calibrate_measured, within_gel

THICKNESSES = (None, 1.5e-3, 3e-3, 6e-3)
"""Thicknesses [m] of the elastic layers; None: gel that sinks in by the fitted rule."""
_BOOK = 5000  # poses among which a touch is looked for
_AROUND = 1e-3  # m above the gel, within which it may bulge out to the object
_PRIOR = np.diag([1e-3**2] * 3 + [np.radians(4.0) ** 2] * 3)  # before alignment: as of the converged filter
_TOUCHES_ONLY = ContactSampling(free_fraction=0.0)
_CHUNK = 250  # maps rendered at a time: bounds memory
_COMMANDED = 0.25e-3, 1e-3  # m, range of the depths of presses
_FROM_MIDDLE = 2e-3  # m, largest offset of a press
_RADII = 2.5e-3, 5e-3  # m of balls
_FACES = 3e-3, 6e-3  # m, sides of flat faces


class SoftSensor:
    """A measured sensor whose gel is an elastic layer, or sinks in by the rule.

    Args: optics: measured; sensor: geometry at full size; thickness: one of `THICKNESSES`; presses: draws the ten
    presses of a ball that calibrate the sensor, None for no calibration. Attribute: about: its columns in a result.
    """

    def __init__(
        self,
        optics: MeasuredOptics,
        sensor: SensorModel,
        thickness: float | None,
        presses: np.random.Generator | None = None,
    ):
        self._sensor, self._optics, self._layer = sensor, optics, None
        if thickness is not None:
            small = sensor.for_maps
            self._layer = ElasticLayer((small.height, small.width), small.pixel_size, thickness)
            # the elastic layer already sinks in
            self._optics = dataclasses.replace(optics, shape=dataclasses.replace(optics.shape, fraction=0.0))
        self.about = {
            "sensor": optics.name,
            "calibrated": presses is not None,
            "thickness_mm": None if thickness is None else 1e3 * thickness,
        }
        known = None if presses is None else calibrate_measured(self._optics, sensor, presses, self._heights)
        self._tdn = load_tdn("fast", sensor, calibration=known)

    def contacts(self, depths: np.ndarray, seed: int) -> list[Contact]:
        """Return the contacts read from objects at depths (N, H, W) m, positive in the untouched gel.

        Each image is the first of a stream. seed: of light and noise.
        """
        camera = MeasuredSensor(self._optics, self._sensor, np.random.default_rng(seed))
        images = camera.images(self._heights(depths))
        return [DepthStage(self._tdn).process(image, camera.background) for image in images]

    def _heights(self, depths: np.ndarray) -> np.ndarray:
        if self._layer is None:
            return within_gel(depths)
        return np.stack([self._layer.pressed(np.maximum(each, -_AROUND))[0] for each in depths])


class SoftGelTouches:
    """Touches on one object. Args: mesh; sensor: at full size; tcn; touches: their number; rng."""

    def __init__(self, mesh: ObjectMesh, sensor: SensorModel, tcn: AnyCodeNet, touches: int, rng: np.random.Generator):
        self._mesh, self._tcn = mesh, tcn
        self._poses = sample_contact_poses(mesh, touches, rng, sensor, _TOUCHES_ONLY)
        self._depths = PenetrationRenderer(mesh, sensor.for_maps, _AROUND).render(self._poses)
        self._alignment = PenetrationAlignment(mesh, sensor.for_maps, NoiseModel.of(FilterConfig()))
        self._book = sample_contact_poses(mesh, _BOOK, rng, sensor)
        parts = np.array_split(self._book, _BOOK // _CHUNK)
        self._codes = np.concatenate([tcn.encode(self._alignment.render(part)) for part in parts])
        self._seed = int(rng.integers(2**32))

    def seen_by(self, sensor: SoftSensor) -> Iterator[dict]:
        """Yield a row for each touch; light and noise are the same on every gel."""
        contacts = sensor.contacts(self._depths, self._seed)
        codes = self._tcn.encode(np.stack([contact.penetration for contact in contacts]))
        errors = single_touch_errors(
            self._book, self._poses, best_matches(self._codes, codes), np.random.default_rng(self._seed)
        ).six_vector
        for k, contact in enumerate(contacts):
            row = {"best_m": errors.best[k], "random_m": errors.random[k]}
            if contact.in_contact:
                row |= self._judged(self._poses[k], self._depths[k], contact.penetration)
            yield {"object": self._mesh.name} | sensor.about | row

    def _judged(self, pose: np.ndarray, depths: np.ndarray, penetration: np.ndarray) -> dict[str, float]:
        found = self._alignment.align(pose, _PRIOR, penetration)
        off = se3.log(se3.inverse(pose) @ found.pose)
        return {
            "deepest": float(penetration.max() / depths.max()),
            "area": float((penetration > 0).sum() / (depths > 0).sum()),
            "normal_mm": 1e3 * float(off[2]),
            "tangential_mm": 1e3 * float(np.hypot(*off[:2])),
            "tilt_deg": float(np.degrees(np.hypot(*off[3:5]))),
        }


class CommandedPresses:
    """Balls and flat faces that are pressed into the gel to a commanded depth. Args: sensor: at full size; presses:
    number of each kind; rng."""

    def __init__(self, sensor: SensorModel, presses: int, rng: np.random.Generator):
        self._depths: dict[str, list[np.ndarray]] = {"ball": [], "flat face": []}
        for _ in range(presses):
            commanded = rng.uniform(*_COMMANDED)
            across, along = rng.uniform(-1, 1, 2) * _FROM_MIDDLE
            radius = rng.uniform(*_RADII)
            centre = np.array([across, along, float(sensor.sag(across, along)) + commanded - radius])
            self._depths["ball"].append(ball_penetration(centre, radius, sensor.for_maps))
            width, depth = rng.uniform(*_FACES, 2)
            face = stacked([Layer(0.01, (rectangle(width, depth, across, along),))], "face")
            pose = np.eye(4)
            pose[2, 3] = 0.005 - commanded
            self._depths["flat face"].append(PenetrationRenderer(face, sensor.for_maps, _AROUND).render(pose[None])[0])
        self._seed = int(rng.integers(2**32))

    def seen_by(self, sensor: SoftSensor) -> Iterator[dict]:
        """Yield a row for each press: its commanded depth, and the depth that is read."""
        for kind, depths in self._depths.items():
            contacts = sensor.contacts(np.stack(depths), self._seed)
            for there, contact in zip(depths, contacts, strict=True):
                read = {"commanded_mm": 1e3 * float(there.max()), "depth_mm": 1e3 * contact.depth_m}
                yield {"press": kind} | sensor.about | read


def report(args: argparse.Namespace) -> dict:
    """Measure touches and presses of known depth on soft gel."""
    meshes = chosen_meshes(args.meshes, args.objects, "out/benchmark")
    sensor = SensorModel.load("digit_real")
    tcn, sensors = load_tcn("fast", sensor), []
    for number, name in enumerate(measured_sensors()):
        optics = MeasuredOptics.load(name)
        for thickness in THICKNESSES:
            sensors.append(SoftSensor(optics, sensor, thickness))
            sensors.append(SoftSensor(optics, sensor, thickness, np.random.default_rng([args.seed, number])))
    commanded = CommandedPresses(sensor, args.presses, np.random.default_rng(args.seed))
    pressed = [row for each in sensors for row in commanded.seen_by(each)]
    touches = []
    for mesh in progress_bar(iterable=meshes, total=len(meshes), unit="object"):
        # the seed of an object does not depend on which others are measured
        rng = np.random.default_rng([args.seed, int(mesh.sha256[:8], 16)])
        touched = SoftGelTouches(mesh, sensor, tcn, args.touches, rng)
        touches += [row for each in sensors for row in touched.seen_by(each)]
    return {"seed": args.seed, "touches": touches, "presses": pressed}
