"""Speed of every stage and of the whole pipeline on one machine: the `bench` JSON."""

from __future__ import annotations

import functools
import itertools
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from midastouch_bringup.datasets import Sequence
from midastouch_bringup.datasets.slide_simulation import no_contact_image
from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.pose_hypothesis import PoseHypothesis
from midastouch_filter.core.touch import Measurement, measurement_of
from midastouch_filter.filter import ParticleFilter
from midastouch_filter.refinement.refinement import is_narrow
from midastouch_filter.smoothing.pace import until_next_frame
from midastouch_perception.codebook import Codebook
from midastouch_perception.rendering.contact_poses import sample_contact_poses
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.simulation.simulated_digit import SimulatedDigit
from midastouch_perception.state_dict import random_state
from midastouch_perception.tcn import load_tcn, minkloc3d_network
from midastouch_perception.tcn.minkloc3d import save_minkloc3d
from midastouch_perception.tdn import fcrn, load_tdn
from midastouch_perception.tdn.fcrn_graph import save_fcrn
from midastouch_perception.tdn.fit_check import FitCheck

from ..trials.cache import Touches
from ..trials.setup import Networks, untouched_of
from .lookup import AlikeCopies, lookup_speed
from .timing import CallTimer, time_calls

COUNTS = (50_000, 10_000, 1_000)
_FINE_STAGES = ("refinement", "hindsight")
_FRAME_TIME = 1 / 60  # s between images
_LOOKUP_FRAMES = 5  # a filter's first steps: particles have drifted off the entries but not gathered yet
_GATHERED = (3e-3, np.radians(6))  # m, rad
_BOOK_POSES = 500
_PAPER_IMAGES = 20
_SENSORS, _SEEDS = ("digit_tacto", "digit_real"), 5
_MODES = 4
_LEAST_STEPS = 10  # with as many modes, for a figure


class SpeedMeasurement:
    """Measures on one slide over one object; each method fills in the keys of the JSON it is named after."""

    def __init__(self, mesh: ObjectMesh, codebook: Codebook, sequence: Sequence, networks: Networks):
        self._mesh, self._codebook, self._networks = mesh, codebook, networks
        self._measured, self._truth = sequence.poses_measured, sequence.poses_true
        self._images = [sequence.image(i) for i in range(sequence.n_frames)]
        self._background = untouched_of(sequence).image

    def networks(self) -> dict:
        """tdn_ms, tcn_ms: one image, one penetration map; calibrated_tdn_ms: one image of a calibrated sensor, whose
        slopes are integrated, with its depth; fit_check_ms: one frame looked at, every fifth is."""
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
        """fcrn_ms, minkloc3d_ms: as tdn_ms and tcn_ms, of the paper's networks, on a few of the images."""
        images = self._images[:: max(1, len(self._images) // _PAPER_IMAGES)]
        penetrations = [self._networks.tdn.predict(image, self._background) for image in images]
        return paper_network_times(images, penetrations, self._networks.sensor)

    def filter(self) -> dict:
        """filter_ms: one step with so many particles, kept at that number, along the slide, without the fine stage;
        fine_stage_ms: what alignment and fixed-lag smoothing add to a step of a 60 Hz camera, by the wall clock."""
        return {
            "filter_ms": {str(count): self._steps(count).summary() for count in COUNTS},
            "fine_stage_ms": {str(count): self._fine_stage(count) for count in COUNTS},
        }

    def four_modes(self) -> dict:
        """four_modes_ms: one step while the map aligns four modes, the particle number adapted, all of the fine stage
        included: on four copies of the object, started near the true pose on each. Nothing if they do not last."""
        copies = AlikeCopies(self._mesh, self._codebook, _MODES)
        config = FilterConfig()
        particle_filter = ParticleFilter(copies.mesh, copies.codebook, config, seed=0)
        spread = np.diag(np.repeat(np.square(_GATHERED), 3))
        particle_filter.initialise_hypotheses(
            [PoseHypothesis(pose, spread, 1 / _MODES) for pose in copies.on_every_copy(self._truth[0])]
        )
        stopwatch, narrow = CallTimer(), []
        for i, touch in enumerate(self._measurements):
            with stopwatch:
                modes = particle_filter.step(self._odometry(i), touch, elapsed=_FRAME_TIME).modes
            narrow.append(sum(is_narrow(mode, config) for mode in modes[:_MODES]))
        chosen = [i >= 2 and count == _MODES for i, count in enumerate(narrow)]
        return {"four_modes_ms": stopwatch.where(chosen).summary()} if sum(chosen) >= _LEAST_STEPS else {}

    @functools.cached_property
    def _measurements(self) -> list[Measurement]:
        """What the filter is told of each frame, where the networks are not timed."""
        return Touches.of_images(self._images, self._background, self._networks, {}).measurements

    def _steps(self, count: int) -> CallTimer:
        particle_filter = self._filter(count, refinement=False)
        stopwatch = CallTimer()
        for i, touch in enumerate(self._measurements):
            with stopwatch:
                particle_filter.step(self._odometry(i), touch)
        stopwatch.drop(2)
        return stopwatch

    def _fine_stage(self, count: int) -> dict[str, float]:
        particle_filter = self._filter(count)
        stages = [
            particle_filter.step(self._odometry(i), touch, elapsed=_FRAME_TIME).status.ms
            for i, touch in enumerate(self._measurements)
        ]
        wall = [sum(ms.get(name, 0.0) for name in _FINE_STAGES) for ms in stages[2:]]
        return {"p50": float(np.median(wall)), "p95": float(np.percentile(wall, 95))}

    def lookup(self) -> dict:
        """lookup_ms: nearest codebook entries of particles one frame after the last look-up, spread over the object;
        lookup_converged_ms: gathered around the true pose; lookup_exact_share: of particles given the nearest entry."""
        touches = self._measurements[:_LOOKUP_FRAMES]
        gathered = self._filter(COUNTS[0])
        gathered.initialise_gaussian(self._truth[0], *_GATHERED)
        speeds = {}
        for name, particle_filter in {"spread": self._filter(COUNTS[0]), "converged": gathered}.items():
            for i, touch in enumerate(touches):
                particle_filter.step(self._odometry(i), touch)
            odometry = self._odometry(len(touches))
            speeds[name] = lookup_speed(particle_filter, self._codebook.poses, odometry, np.random.default_rng(0))
        return {
            "lookup_ms": {str(COUNTS[0]): speeds["spread"].times.summary()},
            "lookup_converged_ms": {str(COUNTS[0]): speeds["converged"].times.summary()},
            "lookup_exact_share": {name: speed.exact_fraction for name, speed in speeds.items()},
        }

    def end_to_end(self) -> dict:
        """end_to_end_ms: image in, estimate out, particle number kept at 50k; frame_ms: that and what is done after the
        answer, as the node does it for a 60 Hz camera; end_to_end_hz: such frames in a second. The `converged` ones
        with the number adapted, started near the true pose, over the frames in state `converged`."""
        answers, frames, _ = self._run(self._filter(COUNTS[0]))
        out = {
            "end_to_end_hz": 1e3 / np.mean(frames.wall_ms),
            "end_to_end_ms": answers.summary(),
            "frame_ms": frames.summary(),
        }
        tracking = self._filter(None)
        tracking.initialise_gaussian(self._truth[0], *_GATHERED)
        answers, frames, states = self._run(tracking)
        converged = [state == "converged" for state in states]
        if any(converged):
            answers, frames = answers.where(converged), frames.where(converged)
            out |= {
                "converged_hz": 1e3 / np.mean(frames.wall_ms),
                "converged_ms": answers.summary(),
                "converged_frame_ms": frames.summary(),
            }
        return out

    def _run(self, particle_filter: ParticleFilter) -> tuple[CallTimer, CallTimer, list[str]]:
        """Times from each image to its estimate and to the end of the frame, and the states."""
        pipeline = self._networks.pipeline()
        answers, frames, states = CallTimer(), CallTimer(), []
        for i, image in enumerate(self._images):
            with frames:
                in_time = until_next_frame(_FRAME_TIME)
                with answers:
                    touch = pipeline.process(image, self._background)
                    estimate = particle_filter.step(self._odometry(i), measurement_of(touch), elapsed=_FRAME_TIME)
                particle_filter.deferred_update(in_time)
            states.append(estimate.status.state)
        answers.drop(2)
        frames.drop(2)
        return answers, frames, states[2:]

    def stepper(self) -> Callable[[], None]:
        """A function that takes one step of the slide, over and over, with 50k particles."""
        particle_filter, touches = self._filter(COUNTS[0]), self._measurements
        frames = itertools.cycle(range(len(touches)))

        def step() -> None:
            frame = next(frames)
            particle_filter.step(self._odometry(frame), touches[frame])

        return step

    def simulator(self) -> dict:
        """renders_per_s: penetration maps of 240 x 320, in batches of 50 contact poses;
        codebook_poses_per_s, rendered and encoded; mesh_faces of the object both are on; sim_image_ms, one image of
        `digit_sim` by the light of the sensor, the mean of several imaginary ones."""
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
        """Of the slide's touches, each seed's sensor taking its fraction of them."""
        stopwatch = CallTimer()
        for seed, poses in enumerate(np.array_split(self._truth[: len(self._images)], _SEEDS)):
            background = no_contact_image(model, np.random.default_rng(seed))
            digit = SimulatedDigit(self._mesh, model, background, seed)
            for pose in poses:
                with stopwatch:
                    digit.look(pose)
        return stopwatch.summary()

    def _filter(self, count: int | None, **settings: bool) -> ParticleFilter:
        """A filter started as the paper does; `count` particles throughout, or as many as it wants."""
        if count is not None:
            settings |= {"min_particles": count, "max_particles": count}
        config = FilterConfig(**settings)
        particle_filter = ParticleFilter(self._mesh, self._codebook, config, seed=0, clock=time.perf_counter)
        particle_filter.initialise_gaussian(self._truth[0], self._mesh.diagonal / 3, np.radians(60))
        return particle_filter

    def _odometry(self, frame: int) -> np.ndarray | None:
        return None if frame == 0 else se3.inverse(self._measured[frame - 1]) @ self._measured[frame]


_VOXEL_SIZE = 1e-3  # the official one


def paper_network_times(images: list[np.ndarray], penetrations: list[np.ndarray], sensor: SensorModel) -> dict:
    """{"fcrn_ms", "minkloc3d_ms"}: times of one image (320, 240, 3) uint8 and one penetration map (160, 120) m.

    With random weights, on which speed does not depend: official ones need not be at hand. Writes and removes 254 MB
    of them.
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
    call(inputs[0])  # what is made on first use
    stopwatch = CallTimer()
    for values in inputs:
        with stopwatch:
            call(values)
    return stopwatch.summary()
