"""Speed of every stage and of the whole pipeline on one machine: the `bench` JSON."""

from __future__ import annotations

import functools
import itertools
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh
from midastouch_common.pose_metric import pose_distance
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.noise_model import NoiseModel
from midastouch_filter.core.pace import until_next_frame
from midastouch_filter.core.particles import Particles
from midastouch_filter.core.state import CONVERGED
from midastouch_filter.core.touch import Measurement, measurement_of
from midastouch_filter.filter import ParticleFilter
from midastouch_perception.codebook import Codebook
from midastouch_perception.rendering.contact_poses import sample_contact_poses
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.state_dict import random_state
from midastouch_perception.tcn import load_tcn, minkloc3d_network
from midastouch_perception.tcn.minkloc3d import save_minkloc3d
from midastouch_perception.tdn import fcrn, load_tdn
from midastouch_perception.tdn.fcrn_graph import save_fcrn
from midastouch_perception.tdn.fit_check import FitCheck
from midastouch_simulation.camera import no_contact_image
from midastouch_simulation.simulated_digit import SimulatedDigit
from midastouch_tools.datasets import Sequence

from ..trials.cache import Touches
from ..trials.setup import Networks, untouched_of
from .timing import CallTimer, time_calls

SEARCHING = "searching"
_FRAME_TIME = 1 / 60  # s between images
_KEYFRAME = 8  # frames of the slide, 12 mm
_NEAR = (3e-3, np.radians(6))  # m, rad
_ALIGNED = 100  # poses
_BOOK_POSES = 500
_KEYS = {
    SEARCHING: ("end_to_end_hz", "end_to_end_ms", "frame_ms"),
    CONVERGED: ("converged_hz", "converged_ms", "converged_frame_ms"),
}
_PAPER_IMAGES = 20
_SENSORS, _SEEDS = ("digit_tacto", "digit_real"), 5


class SpeedMeasurement:
    """Measurements on one slide over one object; each method returns the keys of the JSON that its docstring names."""

    def __init__(self, mesh: ObjectMesh, codebook: Codebook, sequence: Sequence, networks: Networks):
        self._mesh, self._codebook, self._networks = mesh, codebook, networks
        self._measured, self._truth = sequence.poses_measured, sequence.poses_true
        self._images = [sequence.image(i) for i in range(sequence.n_frames)]
        self._background = untouched_of(sequence).image

    def networks(self) -> dict:
        """Return tdn_ms, tcn_ms: of one image, one penetration map; calibrated_tdn_ms: of one image of a calibrated
        sensor, whose slopes are integrated, with its depth; fit_check_ms: of one checked frame, which is every fifth.
        """
        tdn, calibrated, tcn, fit = CallTimer(), CallTimer(), CallTimer(), CallTimer()
        check = FitCheck(self._networks.tdn.sensor, every=1)
        mini = load_tdn("fast", SensorModel.load("gelsight_mini"))  # by its model's calibration
        for image in self._images:
            with calibrated:
                shown = mini.difference(image, self._background)
                mini.depth(shown, mini.predict(image, self._background, shown))
            with tdn:
                penetration = self._networks.tdn.predict(image, self._background)
            with tcn:
                self._networks.tcn.encode(penetration)
            difference = self._networks.tdn.difference(image, self._background)
            with fit:
                check.observe(difference, difference, penetration)
        timed = {"tdn_ms": tdn, "calibrated_tdn_ms": calibrated, "tcn_ms": tcn, "fit_check_ms": fit}
        for stopwatch in timed.values():
            stopwatch.drop(2)
        return {name: stopwatch.summary() for name, stopwatch in timed.items()}

    def paper_networks(self) -> dict:
        """Return fcrn_ms, minkloc3d_ms: as tdn_ms and tcn_ms, of the paper's networks, on a few of the images."""
        images = self._images[:: max(1, len(self._images) // _PAPER_IMAGES)]
        penetrations = [self._networks.tdn.predict(image, self._background) for image in images]
        return paper_network_times(images, penetrations, self._networks.sensor)

    def localisation(self) -> dict:
        """Return times of a 60 Hz camera's frames, handled as in the node: of those before the state is `converged`,
        with nothing known at the start, and of those in that state, started near the true pose.

        filter_ms: one step, until its answer; deferred_ms: the work after the answer; end_to_end_ms, converged_ms: from
        image to estimate; frame_ms, converged_frame_ms: the same, and the work after the answer; end_to_end_hz,
        converged_hz: such frames in a second.
        """
        tracking = self._filter()
        tracking.initialise_gaussian(self._truth[0], *_NEAR)
        runs = {SEARCHING: self._run(self._filter(), False), CONVERGED: self._run(tracking, True)}
        out: dict = {"filter_ms": {}, "deferred_ms": {}}
        for name, (steps, deferred, answers, frames) in runs.items():
            if frames.wall_ms:
                out["filter_ms"][name], out["deferred_ms"][name] = steps.summary(), deferred.summary()
                hz, to_answer, whole = _KEYS[name]
                out |= {hz: 1e3 / np.mean(frames.wall_ms), to_answer: answers.summary(), whole: frames.summary()}
        return out

    def _run(self, particle_filter: ParticleFilter, converged: bool) -> list[CallTimer]:
        """Return times of the step, the deferred work, image to estimate, and the whole frame: of the frames in state
        `converged`, or of the others."""
        pipeline = self._networks.pipeline()
        steps, deferred, answers, frames = timers = [CallTimer() for _ in range(4)]
        chosen = []
        for i, image in enumerate(self._images):
            with frames:
                in_time = until_next_frame(_FRAME_TIME)
                with answers:
                    touch = measurement_of(pipeline.process(image, self._background))
                    with steps:
                        estimate = particle_filter.step(self._odometry(i), touch, elapsed=_FRAME_TIME)
                with deferred:
                    particle_filter.deferred_update(in_time)
            chosen.append(i >= 2 and (estimate.status.state == CONVERGED) == converged)
        return [timer.where(chosen) for timer in timers]

    @functools.cached_property
    def _measurements(self) -> list[Measurement]:
        """Measurements of all frames, for methods that do not time the networks."""
        return Touches.of_images(self._images, self._background, self._networks).measurements

    def alignment(self) -> dict:
        """Return align_ms: of one pose of the codebook, aligned to the penetration map of a touch."""
        particle_filter, poses = self._filter(), self._codebook.poses[:_ALIGNED]
        spread = np.tile(NoiseModel.of(particle_filter.config).between_entries, (len(poses), 1, 1))
        touch = next(each for each in self._measurements if each.in_contact)
        timer = time_calls(lambda: particle_filter.object.alignment.align_each(poses, spread, [touch]), repeats=10)
        return {"align_ms": {name: ms / len(poses) for name, ms in timer.summary().items()}}

    def lookup(self) -> dict:
        """Return lookup_ms: of nearest codebook entries for the poses that no map was compared with, a keyframe after
        the first; lookup_exact_share: fraction of poses that are given the nearest entry."""
        particle_filter = self._filter()
        particle_filter.step(None, self._measurements[0])
        times, exact = lookup_speed(particle_filter, se3.inverse(self._measured[0]) @ self._measured[_KEYFRAME])
        return {"lookup_ms": times.summary(), "lookup_exact_share": exact}

    def stepper(self) -> Callable[[], None]:
        """Return a function that takes one step of the slide, over and over, with nothing known at the start."""
        particle_filter, touches = self._filter(), self._measurements
        frames = itertools.cycle(range(len(touches)))

        def step() -> None:
            frame = next(frames)
            particle_filter.step(self._odometry(frame), touches[frame], elapsed=_FRAME_TIME)

        return step

    def simulator(self) -> dict:
        """Return renders_per_s: penetration maps of 240 x 320, in batches of 50 contact poses; codebook_poses_per_s:
        rendered and encoded; mesh_faces: of the object that both are on; sim_image_ms: of one image of `digit_sim`, by
        the light of the sensor, over several imaginary ones."""
        rng = np.random.default_rng(0)
        poses = sample_contact_poses(self._mesh, 50, rng, self._networks.sensor)
        renderer = PenetrationRenderer(self._mesh, self._networks.sensor)
        renders = time_calls(lambda: renderer.render(poses), repeats=10)
        small = PenetrationRenderer(self._mesh, self._networks.sensor.for_maps)
        book = self._codebook.poses[:_BOOK_POSES]
        building = time_calls(lambda: self._networks.tcn.encode(small.render(book)), repeats=1, warm_up=0)
        return {
            "mesh_faces": len(self._mesh.faces),
            "renders_per_s": 1e3 * len(poses) / np.mean(renders.wall_ms),
            "codebook_poses_per_s": 1e3 * _BOOK_POSES / building.wall_ms[0],
            "sim_image_ms": {model.light: self._simulated_images(model) for model in map(SensorModel.load, _SENSORS)},
        }

    def _simulated_images(self, model: SensorModel) -> dict[str, float]:
        """Return the times of images of the slide's touches, which the sensors of several seeds divide among them."""
        stopwatch = CallTimer()
        for seed, poses in enumerate(np.array_split(self._truth[: len(self._images)], _SEEDS)):
            background = no_contact_image(model, np.random.default_rng(seed))
            digit = SimulatedDigit(self._mesh, model, background, seed)
            for pose in poses:
                with stopwatch:
                    digit.look(pose)
        return stopwatch.summary()

    def _filter(self) -> ParticleFilter:
        """Return a filter as shipped, with nothing known."""
        particle_filter = ParticleFilter(self._mesh, self._codebook, FilterConfig())
        particle_filter.initialise_uniform()
        return particle_filter

    def _odometry(self, frame: int) -> np.ndarray | None:
        return None if frame == 0 else se3.inverse(self._measured[frame - 1]) @ self._measured[frame]


_REPEATS, _TOLERANCE = 40, 1.01


def lookup_speed(particle_filter: ParticleFilter, motion: np.ndarray) -> tuple[CallTimer, float]:
    """Look up the untested poses of a filter on one object after a motion (4, 4) of the gel since the last keyframe.

    Returns the times, and the fraction of poses whose entry is as near, within 1 %, as the nearest. The walk starts at
    the entries that the filter's own look-ups have found, so their misses count, too.
    """
    lookup, untested = particle_filter.object.lookup, particle_filter.belief.untested[0]
    poses = untested.poses @ motion
    particles = Particles.from_poses(poses, untested.entries.copy())

    def look_up() -> np.ndarray:
        particles.entries[:] = untested.entries
        return lookup.follow(particles)

    times = time_calls(look_up, _REPEATS)
    nearest = pose_distance(lookup.poses[lookup.exact(poses)], poses)
    return times, float((look_up() <= _TOLERANCE * nearest + 1e-6).mean())


_VOXEL_SIZE = 1e-3  # the official one


def paper_network_times(images: list[np.ndarray], penetrations: list[np.ndarray], sensor: SensorModel) -> dict:
    """Return {"fcrn_ms", "minkloc3d_ms"}: times of one image (320, 240, 3) uint8 and one penetration map (160, 120) m.

    The weights are random, since speed does not depend on them, and official ones may be missing. Writes and removes
    254 MB of them.
    """
    rng = np.random.default_rng(0)
    with tempfile.TemporaryDirectory() as folder:
        state = random_state(fcrn.expected_shapes(), rng)
        tdn = load_tdn(save_fcrn(state, {"network": "tdn_fcrn"}, Path(folder)), sensor)
        state = random_state(minkloc3d_network.expected_shapes(), rng)
        tcn = load_tcn(save_minkloc3d(state, {"network": "tcn_minkloc3d"}, Path(folder), _VOXEL_SIZE), sensor)
    return {
        "fcrn_ms": _each(lambda image: tdn.predict(image, image), images),
        "minkloc3d_ms": _each(tcn.encode, penetrations),
    }


def _each(call: Callable[[np.ndarray], object], inputs: list[np.ndarray]) -> dict[str, float]:
    rest = itertools.cycle(inputs)
    return time_calls(lambda: call(next(rest)), len(inputs), warm_up=1).summary()
