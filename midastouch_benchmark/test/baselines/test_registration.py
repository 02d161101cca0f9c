import importlib.util
import sys

import numpy as np
import pytest

from midastouch_benchmark.baselines.registration import DeadReckoning
from midastouch_benchmark.trials.trial import TrialFrame, run_trial
from midastouch_benchmark.trials.variants import VARIANTS
from midastouch_common import se3
from midastouch_common.missing_modules import install_extra
from midastouch_filter.core.touch import Measurement
from midastouch_perception.codebook import Codebook
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_model import SensorModel
from midastouch_simulation.slide import simulate_slide

needs_open3d = pytest.mark.skipif(importlib.util.find_spec("open3d") is None, reason="Open3D is an extra")


@needs_open3d
@pytest.mark.slow
def test_a_slide_over_a_tool_is_laid_onto_it(tool):
    from midastouch_benchmark.baselines.registration import Registration

    sensor = SensorModel.load("digit_tacto").scaled(0.25)
    poses = simulate_slide(tool, SensorModel.load("digit_tacto"), 0.15, np.random.default_rng(0))
    maps = PenetrationRenderer(tool, sensor).render(poses)
    book = Codebook(poses[::3], np.ones((len(poses[::3]), 4), np.float32), {"sensor": "digit_tacto"})
    registration = Registration(tool, book)
    registration.initialise_gaussian(poses[40], 0.004, np.radians(5))  # the nearest of the few codebook poses
    first = registration.poses[0]
    states = []
    for motion, measurement in zip(se3.odometry(poses[40:]), maps[40:], strict=True):
        estimate = registration.step(motion, Measurement(True, penetration=measurement))
        states.append(estimate.status.state)
    assert (states[0], states[-1]) == ("ambiguous", "converged")
    started, ended = (np.linalg.norm(a[:3, 3] - b[:3, 3]) for a, b in ((first, poses[40]), (estimate.pose, poses[-1])))
    assert ended < 2e-3
    assert started > 5e-4


def test_where_open3d_is_missing_it_says_so(monkeypatch):
    monkeypatch.setitem(sys.modules, "open3d", None)
    monkeypatch.delitem(sys.modules, "midastouch_tools.inspection.library", raising=False)
    assert install_extra("open3d") in VARIANTS["registration"].missing
    assert VARIANTS["odometry"].missing == ""


@pytest.fixture
def reckoning(mesh, codebook) -> DeadReckoning:
    return DeadReckoning(mesh, codebook)


def test_it_says_nothing_before_a_start(reckoning):
    estimate = reckoning.step(None, Measurement(False))
    assert (estimate.pose, estimate.status.state) == (None, "uninitialised")
    assert reckoning.poses.shape == (0, 4, 4)


def test_it_keeps_its_first_error(reckoning, sequence):
    poses = sequence.poses_true
    reckoning.initialise_gaussian(poses[0], 0.02, 0.3)
    (started,) = reckoning.poses
    for motion in se3.odometry(poses):
        estimate = reckoning.step(motion, Measurement(False))
    assert estimate.status.state == "converged"
    assert estimate.pose == pytest.approx(started @ se3.inverse(poses[0]) @ poses[-1], abs=1e-9)
    assert 1e-3 < np.linalg.norm(started[:3, 3] - poses[0][:3, 3]) < 0.08


def test_the_seed_draws_the_start(reckoning, codebook):
    starts = []
    for seed in (1, 2, 1):
        reckoning.reset(seed)
        reckoning.initialise_uniform()
        starts.append(reckoning.poses[0])
    assert (starts[0] == starts[2]).all()
    assert (starts[0] != starts[1]).any()
    assert (np.abs(codebook.poses - starts[0]).max(axis=(1, 2)) < 1e-9).any()


def test_it_runs_in_a_trial(reckoning, sequence):
    reckoning.initialise_uniform()
    pairs = zip(sequence.poses_measured, sequence.poses_true, strict=True)
    frames = [TrialFrame(k, Measurement(False), {}, *poses, seconds=0.05) for k, poses in enumerate(pairs)]
    assert run_trial(frames, reckoning)["frames_converged"] == 30
