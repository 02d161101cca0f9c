"""What is measured of a stream, and the verdict for /diagnostics."""

import types
from dataclasses import replace

import numpy as np
import pytest

from digit_driver.frames import Frame, ReaderState, ReaderStatus, SourceInfo
from digit_driver.stream_health import Level, StreamEvidence, StreamMonitor, assess
from digit_driver.stream_monitors import ImageHealth, ImageReport, JitterMonitor, RateMonitor
from midastouch_common.clock_offset import ClockOffset
from midastouch_common.message_arrays import SECOND

PERIOD = 16_666_667  # ns, of the stamps
INFO = SourceInfo("/dev/video0", "D20001", 240, 320, 60.0)
STREAMING = ReaderStatus(ReaderState.STREAMING, INFO)
GOOD = ImageReport(mean=90.0, saturated=0.0, repeats=0, problem="")
NORMAL = StreamEvidence(STREAMING, 60.0, 0, GOOD, jitter=0.001, jitter_limit=0.005)


def test_rate_is_known_after_a_window_and_falls_without_frames() -> None:
    monitor = RateMonitor(60.0, now_ns=0)
    for i in range(1, 121):
        monitor.add(i * SECOND // 60)
        if i == 30:
            assert monitor.rate(SECOND // 2) is None
    assert monitor.rate(2 * SECOND) == pytest.approx(60.0)
    assert monitor.rate(2 * SECOND + SECOND // 2) == pytest.approx(30.0, abs=1.0)
    assert monitor.rate(4 * SECOND) == 0.0
    assert monitor.backward == 0


def test_slow_sources_get_a_longer_window() -> None:
    monitor = RateMonitor(0.5, now_ns=0)
    for i in range(10):
        monitor.add(i * 2 * SECOND)
    assert monitor.rate(9 * SECOND) is None
    assert monitor.rate(18 * SECOND) == pytest.approx(0.5)


def test_stamps_that_do_not_advance_are_counted() -> None:
    monitor = RateMonitor(60.0, now_ns=0)
    for stamp in (5, 5, 4, 6):
        monitor.add(stamp)
    assert monitor.backward == 2
    for i in range(1, 121):
        monitor.add(i * SECOND // 60)
    assert monitor.backward == 0, "an old one says nothing about now"


def noisy(rng: np.random.Generator, mean: int = 90) -> np.ndarray:
    return rng.integers(mean - 5, mean + 5, (320, 240, 3)).astype(np.uint8)


def test_good_black_and_saturated_images() -> None:
    rng = np.random.default_rng(1)
    health = ImageHealth(frozen_after=60)
    assert health.update(noisy(rng)).problem == ""
    assert "black" in health.update(np.zeros((320, 240, 3), np.uint8)).problem
    report = health.update(np.full((320, 240, 3), 255, np.uint8))
    assert "saturated" in report.problem
    assert report.saturated == 1.0
    glint = noisy(rng)
    glint[:40] = 255  # An eighth of the image: a reflection, not a fault.
    assert health.update(glint).problem == ""


def test_frozen_stream_is_told_and_forgotten() -> None:
    rng = np.random.default_rng(2)
    health = ImageHealth(frozen_after=3)
    image = noisy(rng)
    problems = [health.update(image).problem for _ in range(4)]
    assert problems[:3] == ["", "", ""]
    assert "frozen" in problems[3]
    assert health.update(noisy(rng)).problem == ""


def test_healthy_stream_is_ok_with_its_figures() -> None:
    report = assess(NORMAL, ClockOffset())
    assert (report.level, report.message) == (Level.OK, "streaming")
    assert report.values["fps"] == "60.00"
    assert report.values["source"] == "/dev/video0"
    assert report.values["stamp_jitter_s"] == "0.001000"
    assert float(report.values["clock_offset_s"]) != 0.0
    assert all(isinstance(value, str) for value in report.values.values())


@pytest.mark.parametrize(
    ("changes", "level", "words"),
    [
        ({"rate": 53.0}, Level.WARN, "53.0 frames/s instead of 60"),
        ({"rate": 55.0}, Level.OK, "streaming"),
        ({"rate": None}, Level.OK, "streaming"),
        ({"backward": 2}, Level.WARN, "did not advance"),
        ({"jitter": 0.0061}, Level.WARN, "uneven by 6.1 ms (limit 5 ms)"),
        ({"jitter": None}, Level.OK, "streaming"),
        ({"jitter": 0.1, "reader": ReaderStatus(ReaderState.STOPPED, INFO)}, Level.OK, "capture is off"),
        ({"image": replace(GOOD, problem="image black")}, Level.WARN, "image black"),
        ({"reader": replace(STREAMING, info=replace(INFO, warnings=("firmware 150",)))}, Level.WARN, "firmware"),
        ({"reader": replace(STREAMING, silent_s=10.0)}, Level.ERROR, "hangs since 10 s"),
        (
            {"reader": ReaderStatus(ReaderState.DISCONNECTED, INFO, last_error="unplugged")},
            Level.ERROR,
            "disconnected: unplugged",
        ),
        ({"reader": ReaderStatus(ReaderState.CONNECTING)}, Level.ERROR, "opening"),
        ({"reader": ReaderStatus(ReaderState.FAILED, last_error="why")}, Level.ERROR, "why"),
        ({"reader": ReaderStatus(ReaderState.STOPPED, INFO), "rate": 0.0}, Level.OK, "capture is off"),
    ],
)
def test_verdicts(changes, level, words) -> None:
    report = assess(replace(NORMAL, **changes), ClockOffset())
    assert report.level == level
    assert words in report.message
    assert bool(report.uneven) == ("uneven" in words)


def test_monitor_stamps_in_wall_time_and_forgets_at_reconnection() -> None:
    clock = types.SimpleNamespace(now=10 * SECOND)
    offset = ClockOffset(monotonic_ns=lambda: clock.now, wall_ns=lambda: clock.now + 1234 * SECOND)
    monitor = StreamMonitor(lambda: clock.now, offset)
    assert monitor.report(ReaderStatus(), 0.005).level == Level.OK
    monitor.opened(INFO)
    rng = np.random.default_rng(4)
    for i in range(61):
        clock.now = 10 * SECOND + i * SECOND // 60
        assert monitor.stamp(Frame(noisy(rng), clock.now, i)) == clock.now + 1234 * SECOND
    assert monitor.report(STREAMING, 0.005).values["fps"] == "60.00"
    assert float(monitor.report(STREAMING, 0.005).values["stamp_jitter_s"]) < 1e-6
    for i in range(120):  # every other image is stamped 6 ms late
        clock.now += SECOND // 60 + (6_000_000 if i % 2 else -6_000_000)
        monitor.stamp(Frame(noisy(rng), clock.now, 61 + i))
    assert "uneven" in monitor.report(STREAMING, 0.005).message
    assert monitor.report(STREAMING, 0.013).message == "streaming"
    clock.now += 5 * SECOND
    assert monitor.report(STREAMING, 0.005).level == Level.WARN
    monitor.opened(INFO)
    assert monitor.report(STREAMING, 0.005).level == Level.OK
    assert "stamp_jitter_s" not in monitor.report(STREAMING, 0.005).values


def watched(stamps, sequences=None) -> JitterMonitor:
    monitor = JitterMonitor()
    for stamp, sequence in zip(stamps, range(len(stamps)) if sequences is None else sequences, strict=True):
        monitor.add(int(stamp), int(sequence))
    return monitor


KEPT = np.flatnonzero(np.random.default_rng(1).random(200) < 0.7)


@pytest.mark.parametrize(
    ("stamps", "sequences"),
    [
        (10**18 + PERIOD * np.arange(100), None),
        (10**18 + (PERIOD + 12_345) * np.arange(100), None),
        (PERIOD * KEPT, KEPT),
        (PERIOD * np.arange(120) + 300_000_000 * (np.arange(120) >= 70), None),
        (PERIOD * np.arange(60), np.zeros(60)),
    ],
    ids=["even", "another period", "lost frames", "a step of the clock", "numbers that do not advance"],
)
def test_stamps_without_jitter(stamps, sequences) -> None:
    assert watched(stamps, sequences).jitter() < 1e-9


def test_the_size_of_the_jitter_is_told() -> None:
    late = np.random.default_rng(2).uniform(0.0, 8e6, 120)
    assert watched(PERIOD * np.arange(120) + late).jitter() == pytest.approx(0.006, abs=0.002)


def test_little_is_known_of_few_frames_and_of_old_ones_nothing() -> None:
    uneven = PERIOD * np.arange(29) + np.arange(29) % 2 * 5_000_000
    assert watched(uneven).jitter() is None
    stamps = np.concatenate([uneven, uneven[-1] + PERIOD * np.arange(1, 150)])
    assert watched(stamps).jitter() < 1e-9
