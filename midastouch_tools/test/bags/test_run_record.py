"""A bag with inputs and results becomes snapshots."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from recorded import edited, write
from run_results import write_run

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_tools.bags.reader import bag_messages
from midastouch_tools.bags.run_record import moments, read_run

FRAMES = 4


@pytest.fixture
def bag(simulated_sequence, tmp_path):
    """Function that writes the bag of a run and returns the sequence and the bag's path."""

    def write(answered=range(FRAMES), **options):
        sequence, path = simulated_sequence(FRAMES), tmp_path / "run.mcap"
        path.unlink(missing_ok=True)
        return sequence, write_run(sequence, path, answered, **options)

    return write


def test_each_answered_frame_is_a_snapshot_with_truth_and_times(bag):
    sequence, path = bag()
    record = read_run(path)
    assert [s.frame for s in record.snapshots] == [0, 1, 2, 3]
    assert [s.time for s in record.snapshots] == pytest.approx([0, 0.1, 0.2, 0.3])
    for i, snapshot in enumerate(record.snapshots):
        assert snapshot.truth == pytest.approx(sequence.poses_true[i], abs=1e-6)
        assert snapshot.particles[0] == pytest.approx(sequence.poses_true[i], abs=1e-6)
        assert snapshot.particles[1] == pytest.approx(np.eye(4))
        assert snapshot.estimate == pytest.approx(sequence.poses_true[i], abs=1e-6)
        assert (snapshot.image == sequence.image(i)).all()
        assert snapshot.penetration.tolist() == [[0, 1], [2, 3], [4, 5]]
        assert snapshot.state == "converged"
        assert (snapshot.n_particles, snapshot.filter_ms) == (700, 3.5)
    (mode,) = record.snapshots[2].modes
    assert mode.weight == 0.75
    assert mode.covariance[1].tolist() == [6, 7, 8, 9, 10, 11]
    codes = [s.code for s in record.snapshots]
    assert codes[1] is None, "without contact there is none"
    assert codes[2] == pytest.approx([0.6, 0.8])
    assert record.node_ms == pytest.approx({"tdn": 4.5})  # weighted by their frames; tcn was idle


def test_of_poses_alike_the_one_nearest_to_the_truth_counts(bag):
    quarter = se3.exp([0, 0, 0, 0, 0, np.pi / 2])
    sequence, path = bag(turns=4, turned=quarter)
    snapshot = read_run(path).snapshots[2]
    truth = sequence.poses_true[2]
    assert len(snapshot.symmetry.transforms) == 4
    for pose in (snapshot.estimate, snapshot.particles[0], snapshot.modes[0].pose):
        assert pose == pytest.approx(truth, abs=1e-6)
    # back by a quarter: what was along y is along x
    covariance = np.arange(36.0).reshape(6, 6)
    assert snapshot.modes[0].covariance[0, 0] == pytest.approx(covariance[1, 1])
    assert snapshot.modes[0].covariance[5, 5] == pytest.approx(covariance[5, 5])
    (third,) = read_run(bag(turns=3, turned=quarter)[1]).snapshots[2].modes
    assert np.linalg.norm(third.pose[:3, :3] - truth[:3, :3]) > 0.1, "a quarter of a turn is not a third"


def test_the_last_word_on_the_object_holds_until_the_next(bag):
    said = {1: {"mug": 0.75, "unknown": 0.25}, 3: {"mug": 1.0, "unknown": 0.0}}
    record = read_run(bag(objects=said)[1])
    assert [s.objects for s in record.snapshots] == [{}, said[1], said[1], said[3]]
    last = record.since_change(0.15).snapshots
    assert [(s.frame, s.objects) for s in last] == [(2, {}), (3, {})]
    assert [s.time for s in last] == pytest.approx([0.05, 0.15])


def test_what_the_recorder_leaves_out_may_be_missing(bag):
    """Penetration maps are not among its topics, and a real run has no pose published before it is sure."""
    record = read_run(bag(without={"/tactile/penetration", "/tactile/code", "/pose", "/diagnostics"})[1])
    for snapshot in record.snapshots:
        assert snapshot.penetration is None
        assert snapshot.code is None
        assert snapshot.estimate is None
        assert len(snapshot.particles) == 2
    assert record.node_ms == {}


def test_a_real_run_has_no_truth(bag, tmp_path):
    _, path = bag()
    measured = tmp_path / "measured.mcap"

    def forget(content):
        content.transforms = content.transforms[:1]

    write(measured, *(edited(m, forget) if m.topic == "/tf" else m for m in bag_messages(path)))
    assert [s.truth for s in read_run(measured).snapshots] == [None] * FRAMES


@pytest.mark.parametrize(
    ("options", "frames"),
    [
        ({"answered": [0, 2, 3], "repeated": [2, 3]}, [0, 2, 3]),
        ({"answered": [0, 2, 3], "waited": [1, 2]}, [0, 2, 3]),
        ({"repeated": [2], "refused": [2]}, [0, 1, 2, 3]),
    ],
    ids=["unanswered and repeated", "an answer is still to come", "the filter refuses the second of a frame"],
)
def test_the_first_answer_to_each_frame_counts(bag, options, frames):
    snapshots = read_run(bag(**options)[1]).snapshots
    assert [(s.frame, s.state, s.n_particles) for s in snapshots] == [(frame, "converged", 700) for frame in frames]


def test_a_run_without_results_is_refused(bag):
    with pytest.raises(InputError, match=r"run\.mcap"):
        read_run(bag(answered=[])[1])


def with_error(run, errors):
    """The run's first snapshot with one particle at each distance [m] from the truth."""
    out = []
    for i, error in enumerate(errors):
        particle = run[0].truth.copy()
        particle[0, 3] += error
        out.append(dataclasses.replace(run[0], frame=i, particles=particle[None]))
    return out


def test_first_and_last_are_always_shown(run):
    chosen = moments(run, 4)
    assert (chosen[0].frame, chosen[-1].frame) == (0, 11)
    assert len(chosen) == 4


def test_more_is_shown_while_the_error_falls(run):
    falling = with_error(run, np.concatenate([np.geomspace(0.1, 0.001, 20), np.full(180, 0.001)]))
    frames = [s.frame for s in moments(falling, 11)]
    assert sum(frame < 20 for frame in frames) >= 5
    assert max(np.diff(frames)) < 60


def test_without_any_progress_the_steps_are_even(run):
    rising = with_error(run, np.linspace(0.01, 0.1, 101))
    assert [s.frame for s in moments(rising, 5)] == [0, 25, 50, 75, 100]


def test_a_short_run_is_shown_whole(run):
    assert [s.frame for s in moments(run[:2], 5)] == [0, 1]
    assert moments(run[:1], 5) == run[:1]
