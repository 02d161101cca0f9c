import numpy as np
import pytest

from digit_driver.jitter_monitor import JitterMonitor

PERIOD = 16_666_667  # ns


def watched(stamps, sequences=None) -> JitterMonitor:
    monitor = JitterMonitor()
    for stamp, sequence in zip(stamps, range(len(stamps)) if sequences is None else sequences, strict=True):
        monitor.add(int(stamp), int(sequence))
    return monitor


def test_even_stamps_have_none_whatever_their_period() -> None:
    for period in (PERIOD, 2 * PERIOD, PERIOD + 12_345):
        assert watched(10**18 + period * np.arange(100)).jitter() < 1e-9


def test_lost_frames_are_no_jitter() -> None:
    kept = np.flatnonzero(np.random.default_rng(1).random(200) < 0.7)
    assert watched(PERIOD * kept, kept).jitter() < 1e-9


def test_the_size_of_the_jitter_is_told() -> None:
    late = np.random.default_rng(2).uniform(0.0, 8e6, 120)
    assert watched(PERIOD * np.arange(120) + late).jitter() == pytest.approx(0.006, abs=0.002)


def test_one_step_of_the_clock_is_no_jitter() -> None:
    stamps = PERIOD * np.arange(120)
    stamps[70:] += 300_000_000
    assert watched(stamps).jitter() < 1e-9


def test_little_is_known_of_few_frames_and_of_old_ones_nothing() -> None:
    uneven = PERIOD * np.arange(29) + np.arange(29) % 2 * 5_000_000
    assert watched(uneven).jitter() is None
    stamps = np.concatenate([uneven, uneven[-1] + PERIOD * np.arange(1, 150)])
    assert watched(stamps).jitter() < 1e-9


def test_numbers_that_do_not_advance_do_no_harm() -> None:
    assert np.isfinite(watched(PERIOD * np.arange(60), np.zeros(60)).jitter())
