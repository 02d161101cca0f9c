"""Pace and order of recordings, on a clock that the test moves."""

import numpy as np
import pytest

from digit_driver.errors import CorruptFrameError, EndOfStreamError
from digit_driver.frame_source import MonotonicClock
from digit_driver.playback import Playback

IMAGE = np.zeros((320, 240, 3), np.uint8)


class ManualClock(MonotonicClock):
    def __init__(self) -> None:
        self.now = 1000

    def now_ns(self) -> int:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += round(seconds * 1e9)


class Three(Playback):
    """Images 0, 1, 2, of which some may be damaged."""

    damaged: tuple[int, ...] = ()

    def _open_recording(self):
        self.next = 0
        return "three", 10.0

    def _next_image(self):
        if self.next == 3:
            return None
        self.next += 1
        if self.next - 1 in self.damaged:
            raise CorruptFrameError("damaged")
        return IMAGE + np.uint8(self.next - 1)

    def _rewind(self):
        self.next = 0

    def close(self):
        pass


def test_frames_come_when_due_and_stamped_so() -> None:
    clock = ManualClock()
    source = Three(clock=clock)
    assert source.open().fps == 10.0
    assert source.read(0.05).stamp_monotonic_ns == 1000
    assert source.read(0.05) is None
    frame = source.read(0.06)
    assert (frame.sequence, frame.stamp_monotonic_ns, clock.now) == (1, 100_001_000, 100_001_000)


def test_a_late_reader_gets_every_frame_with_the_time_it_was_due() -> None:
    clock = ManualClock()
    source = Three(fps=100.0, clock=clock)
    source.open()
    clock.now += 10**9
    frames = [source.read(0.0) for _ in range(5)]
    assert [frame.stamp_monotonic_ns - 1000 for frame in frames] == [i * 10_000_000 for i in range(5)]
    assert [frame.image[0, 0, 0] for frame in frames] == [0, 1, 2, 0, 1]


def test_without_loop_it_ends() -> None:
    source = Three(loop=False, clock=ManualClock())
    source.open()
    for _ in range(3):
        source.read(1.0)
    with pytest.raises(EndOfStreamError):
        source.read(1.0)


def test_damaged_frames_are_passed_over_but_counted() -> None:
    source = Three(clock=ManualClock())
    source.damaged = (0, 1)
    source.open()
    for _ in range(2):
        with pytest.raises(CorruptFrameError):
            source.read(1.0)
    assert source.read(1.0).sequence == 2


def test_opening_again_begins_at_the_beginning() -> None:
    source = Three(clock=ManualClock())
    source.open()
    source.read(1.0)
    source.open()
    assert source.read(1.0).sequence == 0


def test_leds_of_a_recording_are_ignored() -> None:
    Three().set_leds((1, 2, 3))
