import dataclasses

import numpy as np

from midastouch_bringup.bags.snapshot import moments


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
