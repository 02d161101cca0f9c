import numpy as np
import pandas as pd
import pytest

from midastouch_benchmark.statistics.coverage import (
    LEVELS,
    WEIGHTS,
    level_counts,
    nees,
    observed_fractions,
    weight_counts,
)
from midastouch_common import se3
from midastouch_filter.core.estimate import Estimate, Mode
from midastouch_filter.core.state import Status


def estimate_of(pose: np.ndarray, covariance: np.ndarray, n_modes: int = 1, state: str = "converged") -> Estimate:
    modes = [Mode(1.0, pose, covariance, 10)] * n_modes
    return Estimate(modes, Status(state, "", n_modes=n_modes), covariance)


def draws(n: int, scale: float = 1.0):
    """Truths, with estimates that are off as their covariance says, times `scale`."""
    rng = np.random.default_rng(0)
    for _ in range(n):
        factor = rng.normal(0, 1, (6, 6)) * np.repeat([1e-3, 0.02], 3)[:, None]
        error = scale * factor @ rng.standard_normal(6)
        truth = se3.make(se3.random_rotations(1, rng)[0], rng.normal(0, 0.1, 3))
        # the covariance is about the object's axes: translation and rotation both act from the left
        turn = se3.exp(np.concatenate([np.zeros(3), -error[3:]]))[:3, :3]
        pose = se3.make(turn @ truth[:3, :3], truth[:3, 3] - error[:3])
        yield estimate_of(pose, factor @ factor.T), truth


def judged(estimate: Estimate, truth: np.ndarray, right: bool) -> dict:
    """Frame of a trial."""
    status = estimate.status
    return {"nees": nees(estimate, truth), "n_modes": status.n_modes, "state": status.state, "right": right}


def test_nees_averages_six_for_a_right_covariance():
    values = [nees(estimate, truth) for estimate, truth in draws(600)]
    assert np.mean(values) == pytest.approx(6, abs=0.5)


def test_a_right_covariance_covers_as_it_says_a_small_one_less():
    fractions = []
    for scale in (1.0, 2.0):
        frames = [judged(estimate, truth, True) for estimate, truth in draws(500, scale)]
        fractions.append(observed_fractions(level_counts(pd.DataFrame(frames))["right"]))
    assert fractions[0] == pytest.approx(LEVELS, abs=0.05)
    assert (fractions[1][:-2] < LEVELS[:-2]).all()
    assert fractions[1][9] < 0.2


def test_frames_are_counted_by_kind():
    pose, covariance = np.eye(4), 1e-4 * np.eye(6)
    unsure = estimate_of(pose, covariance, n_modes=3, state="ambiguous")
    frames = pd.DataFrame([judged(estimate_of(pose, covariance), pose, True), judged(unsure, pose, False)])
    counts = {kind: sum(values) for kind, values in level_counts(frames).items()}
    assert counts == {"one_mode": 1, "several_modes": 1, "converged": 1, "right": 1}
    assert np.isnan(observed_fractions(np.zeros(len(LEVELS) + 1))).all()


def test_published_poses_are_counted_by_the_weight_of_their_mode():
    frames = [(0.0, False), (0.95, True), (0.96, False), (1.0, True)]
    counts = weight_counts(pd.DataFrame(frames, columns=["mode_mass", "right"]))
    assert len(counts["frames"]) == len(WEIGHTS) + 1
    assert (counts["frames"][0], counts["frames"][-2:]) == (1, [2, 1])
    assert counts["right"][-2:] == [1, 1]


def test_a_covariance_of_zero_is_no_crash():
    assert np.isfinite(nees(estimate_of(np.eye(4), np.zeros((6, 6))), se3.exp(np.full(6, 1e-3))))
