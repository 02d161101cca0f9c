from itertools import pairwise

import numpy as np
import pytest

from midastouch_benchmark.baselines.dead_reckoning import DeadReckoning
from midastouch_benchmark.trials.trial import TrialFrame, run_trial
from midastouch_common import se3
from midastouch_filter.core.touch import Measurement


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
    odometry = [None, *(se3.inverse(before) @ after for before, after in pairwise(poses))]
    for motion in odometry:
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
