"""Probes of the code that makes estimates, on small scenes: touches of bundled objects, made like those of reports.

Simulator, networks, renderer and codebook are probed at fixed poses, each stage with its own input; so are the poses of
a slide, and the way from images of real gel to a contact, on measured sensors, calibrated and not. Filter,
identification and advice are probed under each protocol. Each run is short, and its touches lie far apart: much happens
before an error of the last bit has grown.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path

import numpy as np

from midastouch_common.mesh import ObjectMesh
from midastouch_filter.active_touch.suggestion import Advisor, Wanted
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.estimate import Estimate
from midastouch_filter.core.noise_model import NoiseModel
from midastouch_filter.core.object_model import ObjectModel
from midastouch_filter.core.state import STATES
from midastouch_filter.core.touch import Measurement, measurement_of
from midastouch_filter.core.workers import Workers
from midastouch_filter.filter import ParticleFilter
from midastouch_perception.codebook import Codebook
from midastouch_perception.codebook_build import CodebookBuild
from midastouch_perception.objects import bundled_objects
from midastouch_perception.pipeline import DepthStage
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_calibration.calibration import SensorCalibration, standard_colours
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tdn import load_tdn
from midastouch_simulation.camera import TactoCamera
from midastouch_simulation.grasp import simulate_grasp
from midastouch_simulation.measured_optics import MeasuredOptics, MeasuredSensor, measured_sensors
from midastouch_simulation.slide import measure_poses, simulate_slide
from midastouch_tools.datasets.slide_simulation import NOISE_R, NOISE_T

from ..trials.cache import LIGHT
from ..trials.disturbances import UndisturbedSlide
from ..trials.protocols import PROTOCOLS
from ..trials.real_sensor import calibrate_measured
from ..trials.sequence_trials import start_filter
from ..trials.setup import Networks
from ..trials.trial import FRAME_TIME, TrialFrame, with_odometry

_MARGIN = 4.0  # tolerance of a number over the largest change by nudges
_WILD = 4.0  # times a difference that does not matter: beyond, nudges lead elsewhere
_ELSEWHERE = 3.0  # times its tolerance by which a number may be off on a machine of another kind
_ODD = 0.02  # of a probe's numbers may be off further: a particle more or less was drawn there
_DIGITS = 6


@dataclass(frozen=True)
class Probe:
    """Probe of code. values: (T, K), K numbers at T moments; tolerance: (K,) or (T, K), by which they may differ."""

    values: np.ndarray
    tolerance: Sequence[float] | np.ndarray

    def steadied(self, nudged: Sequence[Probe]) -> Probe:
        """Return the moments before the first one at which nudged inputs lead elsewhere, with tolerances that include
        the effect of nudges until then; nudged: probes of such inputs."""
        off = np.max([np.abs(each.values - self.values) for each in nudged], axis=0)
        wild = np.flatnonzero((off > _WILD * np.asarray(self.tolerance)).any(axis=1))
        steady = slice(wild[0] if len(wild) else None)
        return Probe(self.values[steady], np.maximum(self.tolerance, _MARGIN * off)[steady])

    def agrees(self, other: Probe) -> bool:
        """Return whether the numbers of another probe agree with these, at the moments of this one."""
        theirs = other.values[: len(self.values)]
        same = theirs.shape == self.values.shape
        return same and bool(np.mean(np.abs(theirs - self.values) > _ELSEWHERE * np.asarray(self.tolerance)) <= _ODD)

    def to_json(self) -> dict:
        """Return the content that `from_json` reads."""
        parts = {"values": self.values, "tolerance": np.broadcast_to(self.tolerance, self.values.shape)}
        return {
            name: [[float(f"{x:.{digits}g}") for x in row] for row in np.asarray(part).tolist()]
            for (name, part), digits in zip(parts.items(), (_DIGITS, 2), strict=True)
        }

    @classmethod
    def from_json(cls, content: dict) -> Probe:
        """Return the probe whose content `to_json` returned."""
        return cls(np.array(content["values"], float), np.array(content["tolerance"], float))


Probes = dict[str, Probe]


# by object; each touch is a keyframe. In a file, so that a change to the simulated slides does not change the touches
_POSES_OF = Path(__file__).parent / "poses.npz"
_POSES = 3_000
Rng = np.random.Generator | None
NUDGE = 1e-6
"""Relative error of the inputs of a nudged probe, as large as machines differ."""


@dataclass(frozen=True)
class ProbeScene:
    """Touches on a small object: mesh, networks, true poses (N, 4, 4) of touches 12 mm apart."""

    mesh: ObjectMesh
    networks: Networks
    poses: np.ndarray

    @classmethod
    def of(cls, name: str) -> ProbeScene:
        """Return the scene of a bundled object whose poses are in the file."""
        with np.load(_POSES_OF) as poses:
            return cls(ObjectMesh.load(bundled_objects()[name]), Networks.load(light=LIGHT), poses[name])

    @cached_property
    def codebook(self) -> Codebook:
        """Small codebook of the whole surface."""
        return CodebookBuild(self.mesh, self.networks.tcn, self.networks.sensor, _POSES).run()

    def images(self, poses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return images (N, H, W, 3) uint8 at poses (N, 4, 4), and the no-contact image (H, W, 3)."""
        rng = np.random.default_rng(0)
        camera = TactoCamera(self.networks.sensor, rng)
        maps, normals = PenetrationRenderer(self.mesh, self.networks.sensor).render_with_normals(poses)
        return np.array([camera.image(*each, rng) for each in zip(maps, normals, strict=True)]), camera.background

    @cached_property
    def frames(self) -> list[TrialFrame]:
        """Frames of the slide, as a filter gets them."""
        return self._perceived(self.poses, measure_poses(self.poses, np.random.default_rng(0), NOISE_T, NOISE_R))

    def _perceived(self, poses: np.ndarray, measured: np.ndarray) -> list[TrialFrame]:
        pipeline, (images, background) = self.networks.pipeline(), self.images(poses)
        touches = [measurement_of(pipeline.process(image, background)) for image in images]
        return [
            TrialFrame(k, touch, {}, at, truth, FRAME_TIME)
            for k, (touch, at, truth) in enumerate(zip(touches, measured, poses, strict=True))
        ]

    @cached_property
    def grasp(self) -> list[TrialFrame]:
        """Frames of a grasp, one for each contact, as `protocols.grasp` gets them."""
        poses = simulate_grasp(self.mesh, self.networks.sensor, np.random.default_rng(0))
        return self._perceived(poses, poses)


def off(values: np.ndarray, rng: Rng) -> np.ndarray:
    """Return numbers off by `NUDGE`; of grey levels from 0 to 255, a few are off by one. rng: None leaves them."""
    if rng is None:
        return values
    if values.dtype == np.uint8:
        return np.where(rng.random(values.shape) < NUDGE * 255, values ^ 1, values)
    return (values * (1 + NUDGE * rng.uniform(-1, 1, values.shape))).astype(values.dtype)


def nudged(frames: list[TrialFrame], rng: Rng) -> list[TrialFrame]:
    """Return the frames with codes, maps and measured poses as by `off`."""

    def touch(one: Measurement) -> Measurement:
        if not one.in_contact:
            return one
        return dataclasses.replace(one, code=off(one.code, rng), penetration=off(one.penetration, rng))

    def pose(one: np.ndarray) -> np.ndarray:
        out = one.copy()
        out[:3, 3] = off(one[:3, 3], rng)
        return out

    return [
        dataclasses.replace(
            frame,
            measurement=touch(frame.measurement),
            measured=pose(frame.measured),
            others={name: touch(each) for name, each in frame.others.items()},
        )
        for frame in frames
    ]


_LEAST = (*[1e-4] * 3, *[5e-3] * 6, 1e-2, 5e-2, 1e-2, 1e-2, 3e-2, 3e-2, 5e-2, 0.1)
"""Differences that do not matter, by number of `_answer`: m, rotation entries, masses, logarithms, nats, a state."""
_FEW = 1_000
"""Particles of most probes."""
_MOST = 16  # frames
# differ from `plain` in object or sensor
_UNLIKE_PLAIN = "real_sensor", "real_sensor_calibrated", "camera_faults", "small_parts"


def filter_probes(scenes: list[ProbeScene], config: FilterConfig, rng: Rng = None) -> Probes:
    """Return probes of two scenes by name; rng: of a nudge to the frames, as `nudged`."""
    config = dataclasses.replace(config, threads=1)
    few = dataclasses.replace(config, max_particles=_FEW)
    tool, eyebolt = scenes
    out = {}
    for k, (name, protocol) in enumerate(PROTOCOLS.items()):
        if name in _UNLIKE_PLAIN:
            continue
        frames = eyebolt.grasp if name == "grasp" else eyebolt.frames
        given = UndisturbedSlide(frames, np.random.default_rng(k), tool.frames, eyebolt.codebook)
        frames = nudged(protocol.disturb(given).frames, rng)[:_MOST]
        out[name] = _run(eyebolt, frames, few, protocol.starts[0], protocol.beta)
    frames = nudged(tool.frames, rng)
    out["tool"] = _run(tool, frames, few, "paper", 0.2)
    out["tool, nothing known"] = _run(tool, frames, few, "uniform", 1.0)
    for name, start in (("as shipped", ("paper", 1.0)), ("as shipped, nothing known", ("uniform", 1.0))):
        out[name] = _run(eyebolt, nudged(eyebolt.frames, rng), config, *start)
    codes = dataclasses.replace(few, refinement=False)
    out["codes"] = _run(eyebolt, nudged(eyebolt.frames, rng), codes, "paper", 0.5)
    out["identity"] = _identity(scenes, frames, few)
    out["advice"] = _advice(tool, frames, few)
    return out


def _run(scene: ProbeScene, frames: list[TrialFrame], config: FilterConfig, init: str, beta: float) -> Probe:
    estimates, _ = _estimates(scene, frames, config, init, beta)
    return Probe(np.array([_answer(each) for each in estimates]), _LEAST)


def _estimates(
    scene: ProbeScene, frames: Iterable[TrialFrame], config: FilterConfig, init: str, beta: float
) -> tuple[list[Estimate], ParticleFilter]:
    """Return an estimate for each frame, and the filter at the end."""
    particle_filter, out = ParticleFilter(scene.mesh, scene.codebook, config), []
    start_filter(particle_filter, scene.mesh, scene.poses[0], init, beta)
    for frame, odometry in with_odometry(frames):
        out.append(particle_filter.step(odometry, frame.measurement, frame.others, frame.seconds))
    return out, particle_filter


def _answer(estimate: Estimate) -> list[float]:
    status, pose = estimate.status, estimate.pose
    return [
        *pose[:3, 3],
        *pose[:3, :2].ravel(),
        status.mode_mass,
        np.log(status.ess),
        np.log(status.n_particles),
        status.likelihood_trend,
        np.log(status.spread_t + 1e-6),
        np.log(status.spread_r + 1e-6),
        np.log(np.trace(estimate.covariance[:3, :3])),
        STATES.index(status.state),
    ]


def _identity(scenes: list[ProbeScene], frames: list[TrialFrame], config: FilterConfig) -> Probe:
    """Probe the probabilities of the objects and of none, and the position of the gel on the leading one."""
    about = config, NoiseModel.of(config), Workers(config.threads)
    particle_filter = ParticleFilter.on([ObjectModel(each.mesh, each.codebook, *about) for each in scenes], config)
    particle_filter.initialise_uniform()
    rows = []
    for frame, odometry in with_odometry(frames):
        estimate = particle_filter.step(odometry, frame.measurement, elapsed=frame.seconds)
        probabilities, unknown = particle_filter.identity
        rows.append([unknown, *probabilities, *estimate.pose[:3, 3]])
    return Probe(np.array(rows), [3e-3] * 3 + [2e-5] * 3)


def _advice(scene: ProbeScene, frames: list[TrialFrame], config: FilterConfig) -> Probe:
    """Probe information, cost, length and heading of the best suggestions, early and later."""
    rows = []
    for count in (1, 3, len(frames) // 2):
        _, particle_filter = _estimates(scene, frames[:count], config, "uniform", 1.0)
        advice = Advisor(particle_filter).advise(Wanted(lifts=True))
        best = advice.suggestions[0] if advice.suggestions else None
        rows.append([best.information, best.cost, best.length, best.heading] if best else [0.0] * 4)
    return Probe(np.array(rows), (1e-2, 1e-4, 1e-4, 1e-3))


_TOUCHES, _ENTRIES, _NUMBERS = 4, 12, 12  # touches, entries of a codebook, numbers of a code
_BLOCKS = 4, 3  # of an image or a map
_SLIDE = 0.09  # m


def perception_probes(scene: ProbeScene, rng: Rng = None) -> Probes:
    """Return probes by name; rng: of nudges to images, poses and maps, as `off`."""
    networks, poses = scene.networks, scene.poses[:_TOUCHES]
    images, background = scene.images(poses)
    pipeline = networks.pipeline()
    contacts = [pipeline.process(off(image, rng), background).contact for image in images]
    small = PenetrationRenderer(scene.mesh, networks.sensor.for_maps)
    maps = small.render(off(poses, rng))
    book = scene.codebook
    entries = slice(None, None, len(book.poses) // _ENTRIES)
    return {
        "images": Probe(block_means(images.mean(axis=-1)), [0.1] * 12),
        "depth": Probe(block_means(np.array([each.penetration for each in contacts])), [2e-6] * 12),
        "contact": Probe(np.array([[1e6 * each.area_m2] for each in contacts]), [0.5]),
        "rendered": Probe(block_means(maps), [1e-6] * 12),
        "codes": Probe(networks.tcn.encode(off(maps, rng))[:, :_NUMBERS], [1e-3] * _NUMBERS),
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


def real_gel_probes(mesh: ObjectMesh, poses: np.ndarray, rng: Rng = None) -> Probes:
    """Return probes by name; poses: (N, 4, 4) that touch the mesh; rng: of nudges to images, as `off`."""
    sensor, which = SensorModel.load("digit_real"), measured_sensors()[0]
    calibration = _calibration(which)
    maps = PenetrationRenderer(mesh, sensor.for_maps).render(poses[:_TOUCHES])
    camera = MeasuredSensor(MeasuredOptics.load(which), sensor, np.random.default_rng(0))
    images = [*camera.images(maps)]
    probes = {}
    for name, given in (("uncalibrated", None), ("calibrated", calibration)):
        stage = DepthStage(load_tdn("fast", sensor, given))
        contacts = [stage.process(off(image, rng), camera.background) for image in images]
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
