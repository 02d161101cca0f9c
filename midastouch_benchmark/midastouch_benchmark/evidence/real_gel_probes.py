"""Probes of the way from images of real gel to a contact, on measured sensors, calibrated and not."""

from __future__ import annotations

from functools import cache

import numpy as np

from midastouch_common.mesh import ObjectMesh
from midastouch_perception.pipeline import DepthStage
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_calibration.calibration import SensorCalibration, standard_colours
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tdn import load_tdn
from midastouch_simulation.measured_optics import MeasuredOptics, MeasuredSensor, measured_sensors

from ..trials.real_sensor import calibrate_measured
from .perception_probes import Nudge, block_means
from .probe import Probe, Probes

_TOUCHES = 4
_SLOPES = np.linspace(-0.5, 0.5, 10).reshape(5, 2)


def real_gel_probes(mesh: ObjectMesh, poses: np.ndarray, nudge: Nudge = lambda values: values) -> Probes:
    """Return probes by name; poses: (N, 4, 4) that touch the mesh; nudge: changes images before a stage gets them."""
    sensor, which = SensorModel.load("digit_real"), measured_sensors()[0]
    calibration = _calibration(which)
    maps = PenetrationRenderer(mesh, sensor.for_maps).render(poses[:_TOUCHES])
    camera = MeasuredSensor(MeasuredOptics.load(which), sensor, np.random.default_rng(0))
    images = [*camera.images(maps)]
    probes = {}
    for name, given in (("uncalibrated", None), ("calibrated", calibration)):
        stage = DepthStage(load_tdn("fast", sensor, given))
        contacts = [stage.process(nudge(image), camera.background) for image in images]
        depth = block_means(np.array([each.penetration for each in contacts]))
        probes[f"depth, {name}"] = Probe(depth, [2e-6] * depth.shape[1])
        whole = np.array([[1e6 * each.area_m2, 1e3 * each.depth_m] for each in contacts])
        probes[f"contact, {name}"] = Probe(whole, [0.5, 0.01])
    mini = SensorCalibration.default(SensorModel.load("gelsight_mini"))
    seen = mini.response.slopes(np.tile(standard_colours(_SLOPES)[:, None], (1, 4, 1)))
    return probes | {"slopes by default": Probe(seen.reshape(len(_SLOPES), -1), [1e-3] * 8)}


@cache
def _calibration(which: str) -> SensorCalibration:
    """Return the calibration of one of the measured sensors, as by `midastouch calibrate`."""
    return calibrate_measured(MeasuredOptics.load(which), SensorModel.load("digit_real"), np.random.default_rng(0))
