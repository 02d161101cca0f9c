import json

import numpy as np
import pytest

from midastouch_benchmark.statistics.accuracy import summarise_trials
from midastouch_benchmark.trials.sequence_trials import TrialPlan, run_sequence
from midastouch_benchmark.trials.setup import untouched_of
from midastouch_benchmark.trials.trial import AFTER_EVENT, Event, TrialFrame, run_trial
from midastouch_benchmark.trials.yardstick import Yardstick
from midastouch_common import se3
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.estimate import Estimate, Mode
from midastouch_filter.core.state import AMBIGUOUS, CONVERGED, Status
from midastouch_filter.core.touch import Measurement
from midastouch_perception.symmetry.group import Symmetry
from midastouch_tools.result_file import to_json

CONFIG = FilterConfig(max_particles=3000)
KEYS = {
    "sequence", "object", "init", "frames", "wall_s", "hz_mean", "hz_p05", "ms", "final",
    "converged_at_frame", "per_frame",
}  # fmt: skip
FINAL_KEYS = {
    "e_trans_mm", "e_rot_deg", "min_cluster_trans_mm", "min_cluster_rot_deg", "estimate_trans_mm",
    "estimate_rot_deg", "n_particles", "state", "right", "among_modes",
}  # fmt: skip


@pytest.fixture(scope="module")
def evaluated(sequence, mesh, codebook, networks):
    return run_sequence(sequence, mesh, codebook, networks, CONFIG, TrialPlan(), untouched_of(sequence))


def test_a_trial_has_the_keys_of_the_file_format(evaluated):
    trial = evaluated[1]
    assert set(trial) >= KEYS
    assert set(trial["final"]) >= FINAL_KEYS
    assert set(trial["ms"]) == {"tdn", "tcn", "filter"}
    assert trial["filter_cpu_ms"] > 0
    assert trial["contact_area_mm2"] == pytest.approx(100)
    # stages lie within a step; on a busy machine much may lie between them
    assert 0 < sum(trial["filter_stages_ms"].values()) <= 1.001 * trial["ms"]["filter"]
    assert all(len(column) == trial["frames"] == 30 for column in trial["per_frame"].values())
    json.dumps(to_json(evaluated), allow_nan=False)


def test_final_errors_are_the_last_frames_and_smaller(evaluated):
    trial = evaluated[1]
    assert trial["final"]["e_trans_mm"] == trial["per_frame"]["e_trans_mm"][-1]
    assert max(trial["final"][f"{what}_trans_mm"] for what in ("e", "estimate")) < trial["initial"]["e_trans_mm"]
    assert trial["final"]["min_cluster_trans_mm"] <= trial["final"]["estimate_trans_mm"] + 1e-9


def test_rates_count_the_whole_pipeline(evaluated):
    trial = evaluated[1]
    assert trial["hz_mean"] == pytest.approx(trial["frames"] / trial["wall_s"])
    assert trial["hz_p05"] == pytest.approx(1e3 / np.percentile(trial["per_frame"]["ms"], 95))
    assert sum(trial["per_frame"]["ms"]) == pytest.approx(1e3 * trial["wall_s"])


def test_a_sequence_always_gives_the_same_trial(evaluated, sequence, mesh, codebook, networks):
    again = run_sequence(sequence, mesh, codebook, networks, CONFIG, TrialPlan(), untouched_of(sequence))[1]
    assert again["per_frame"]["e_trans_mm"] == evaluated[1]["per_frame"]["e_trans_mm"]


@pytest.mark.slow
def test_uniform_start_does_not_look_at_the_truth(sequence, mesh, codebook, networks):
    other = type(sequence)(**vars(sequence))
    other.poses_true = np.roll(sequence.poses_true, 7, axis=0)
    plan = TrialPlan(init="uniform", max_frames=5)
    first, second = (
        run_sequence(s, mesh, codebook, networks, CONFIG, plan, untouched_of(s))[1]["per_frame"]
        for s in (sequence, other)
    )
    assert [e.tolist() for e in first["estimate"]] == [e.tolist() for e in second["estimate"]]
    assert first["e_trans_mm"] != second["e_trans_mm"]


def test_stride_and_limit_choose_the_frames(sequence, mesh, codebook, networks):
    done = []
    plan = TrialPlan(stride=4, max_frames=3)
    free = untouched_of(sequence)
    description, trial = run_sequence(sequence, mesh, codebook, networks, CONFIG, plan, free, done.append)
    assert trial["per_frame"]["frame"] == [0, 4, 8]
    assert np.shape(description["truth"]) == (3, 7)
    assert sum(done) == 3


def test_missing_errors_are_counted_not_averaged(evaluated):
    trials = [{**evaluated[1], "final": dict(evaluated[1]["final"])} for _ in range(3)]
    trials[0]["final"]["estimate_trans_mm"] = float("nan")
    summary = summarise_trials(trials)["estimate_trans_mm"]
    assert summary["missing"] == 1
    assert np.isfinite(summary["mean"])


HALF_TURN = se3.make(np.diag([-1.0, -1.0, 1.0]), np.zeros(3))


class KnowsThePoses:
    """A filter that is sure of the poses it was given, one a step."""

    weights = np.ones(1)

    def __init__(self, poses: np.ndarray):
        self._left = list(poses)
        self.poses = poses[:1]

    def step(self, odometry, measurement, elapsed=None) -> Estimate:
        pose = self._left.pop(0)
        self.poses = pose[None]
        status = Status(CONVERGED, "sure", n_particles=1, n_modes=1, mode_mass=1.0)
        return Estimate([Mode(1.0, pose, np.eye(6) * 1e-6, 1)], status, np.eye(6) * 1e-6)


class KnowsTwoPoses(KnowsThePoses):
    """One that publishes the first of two poses, and says that it may be the other."""

    def __init__(self, first: np.ndarray, second: np.ndarray):
        super().__init__(first)
        self._second = list(second)

    def step(self, odometry, measurement, elapsed=None) -> Estimate:
        (first,) = super().step(odometry, measurement).modes
        modes = [Mode(0.5, pose, first.covariance, 1) for pose in (first.pose, self._second.pop(0))]
        status = Status(AMBIGUOUS, "either", n_particles=1, n_modes=2, mode_mass=0.5)
        return Estimate(modes, status, first.covariance)


def run_knowing(known: np.ndarray, truth: np.ndarray, **options) -> dict:
    frames = [TrialFrame(i, Measurement(True), {}, pose, pose) for i, pose in enumerate(truth)]
    return run_trial(frames, KnowsThePoses(known), **options)


@pytest.fixture(scope="module")
def poses(sequence) -> np.ndarray:
    """60 poses on the block."""
    return np.concatenate([sequence.poses_true, sequence.poses_true[::-1]])


def test_a_symmetric_pose_is_as_good_where_the_yardstick_says_so(poses):
    symmetry = Symmetry(np.array([np.eye(4), HALF_TURN]))
    turned, plain = HALF_TURN @ poses, run_knowing(poses, poses)
    assert plain["frames_converged_right"] == 60
    strict, lenient = (run_knowing(turned, poses, yardstick=Yardstick(group)) for group in (Symmetry(), symmetry))
    assert strict["frames_converged_right"] == 0
    assert (strict["final"]["right"], lenient["final"]["right"]) == (False, True)
    assert lenient["frames_converged_right"] == 60
    assert lenient["coverage"] == plain["coverage"]
    for key in ("e_trans_mm", "estimate_rot_deg", "closest_mode_trans_mm"):
        assert lenient["final"][key] == pytest.approx(0, abs=1e-5)


def test_a_truth_among_modes_is_told_of_each_ambiguous_frame(poses):
    frames = [TrialFrame(i, Measurement(True), {}, pose, pose) for i, pose in enumerate(poses)]
    second = poses.copy()
    second[40:] = HALF_TURN @ second[40:]
    trial = run_trial(frames, KnowsTwoPoses(HALF_TURN @ poses, second))
    assert (trial["frames_ambiguous"], trial["frames_ambiguous_among"]) == (60, 40)
    assert (trial["final"]["right"], trial["final"]["among_modes"]) == (False, False)
    shorter = run_trial(frames[:40], KnowsTwoPoses(HALF_TURN @ poses, second))
    assert (shorter["final"]["right"], shorter["final"]["among_modes"]) == (False, True)
    assert (trial["right_m"], trial["right_deg"]) == (0.01, pytest.approx(20))


def test_it_is_asked_again_some_frames_after_the_event(poses):
    known = poses.copy()
    known[40:, 2, 3] += 0.012  # m
    events = [Event(start, end) for start, end in ((1, 1), (3, 9), (3, 10), (20, 29), (41, 41))]
    asked = [run_knowing(known, poses, event=event) for event in (None, *events)]
    assert AFTER_EVENT == 30
    assert [trial["event_at"] for trial in asked] == [None, 1, 9, 10, 29, 41]
    assert [trial["right_after_event"] for trial in asked] == [None, True, True, False, False, None]
    assert [trial["right_before_event"] for trial in asked] == [None, True, True, True, True, False]
    lenient = Yardstick(distance=0.015)
    assert run_knowing(known, poses, event=Event(3, 10), yardstick=lenient)["right_after_event"] is True


def test_without_a_truth_nothing_is_right_and_nothing_covered(poses):
    nowhere = run_knowing(poses, np.full_like(poses, np.nan))
    assert (nowhere["frames_converged"], nowhere["frames_converged_right"]) == (60, 0)
    assert sum(nowhere["coverage"]["converged"]) == 0
    assert nowhere["frames_ambiguous"] == 0
    json.dumps(to_json(nowhere), allow_nan=False)
