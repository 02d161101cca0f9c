"""Probes of simulator, networks, renderer and codebook at fixed poses, each stage with its own input; of the poses of a
slide; and of the way from images of real gel to a contact, on measured sensors, calibrated and not."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from midastouch_common.mesh import ObjectMesh
from midastouch_perception.pipeline import DepthStage
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_calibration.calibration import SensorCalibration, standard_colours
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tdn import load_tdn
from midastouch_simulation.measured_optics import MeasuredOptics, MeasuredSensor, measured_sensors
from midastouch_simulation.slide import simulate_slide

from ..trials.real_sensor import calibrate_measured
from .probe import Probe, Probes
from .scene import ProbeScene

_TOUCHES, _ENTRIES, _NUMBERS = 4, 12, 12  # touches, entries of a codebook, numbers of a code
_BLOCKS = 4, 3  # of an image or a map
_SLIDE = 0.09  # m
Nudge = Callable[[np.ndarray], np.ndarray]


def perception_probes(scene: ProbeScene, nudge: Nudge = lambda values: values) -> Probes:
    """Return probes by name; nudge: changes images, poses and maps before a stage gets them."""
    networks, poses = scene.networks, scene.poses[:_TOUCHES]
    images, background = scene.images(poses)
    pipeline = networks.pipeline()
    contacts = [pipeline.process(nudge(image), background).contact for image in images]
    small = PenetrationRenderer(scene.mesh, networks.sensor.for_maps)
    maps = small.render(nudge(poses))
    book = scene.codebook
    entries = slice(None, None, len(book.poses) // _ENTRIES)
    return {
        "images": Probe(block_means(images.mean(axis=-1)), [0.1] * 12),
        "depth": Probe(block_means(np.array([each.penetration for each in contacts])), [2e-6] * 12),
        "contact": Probe(np.array([[1e6 * each.area_m2] for each in contacts]), [0.5]),
        "rendered": Probe(block_means(maps), [1e-6] * 12),
        "codes": Probe(networks.tcn.encode(nudge(maps))[:, :_NUMBERS], [1e-3] * _NUMBERS),
        "book": Probe(book.poses[entries, :3].reshape(-1, 12), [1e-4] * 12),
        "book's codes": Probe(book.codes[entries, :_NUMBERS], [2e-3] * _NUMBERS),
        "calibration of codes": Probe(np.array([[book.meta["temperature"], book.meta["outlier"]]]), [1e-6] * 2),
    }


def slide_probes(scenes: list[ProbeScene]) -> Probes:
    """Return a probe of a slide over each object, by object."""
    return {each.mesh.name: _slide(each) for each in scenes}


def _slide(scene: ProbeScene) -> Probe:
    poses = simulate_slide(scene.mesh, scene.networks.sensor, _SLIDE, np.random.default_rng(0))
    return Probe(np.hstack([poses[:, :3, 3], poses[:, :3, :2].reshape(-1, 6)]), [1e-6] * 3 + [1e-4] * 6)


def block_means(pictures: np.ndarray) -> np.ndarray:
    """Return means (N, 12) over the blocks of pictures (N, H, W)."""
    rows = np.array_split(pictures, _BLOCKS[0], axis=1)
    return np.stack([b.mean(axis=(1, 2)) for row in rows for b in np.array_split(row, _BLOCKS[1], axis=2)], axis=1)


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
