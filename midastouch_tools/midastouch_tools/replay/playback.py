"""Timing of the messages of a replay: pace, pause, single steps, seeks."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from midastouch_common.message_arrays import SECOND

_SOON_S = 1e-6  # a wait shorter than this only spins


class Playback:
    """State shared by the thread that plays and those that control it; every method may be called from any thread.

    Args:
        rate: seconds of recorded time per second; 0 plays as fast as the consumer takes it.
        paused: start in pause.
        now: monotonic clock in seconds.

    Attributes: changed: condition that is notified of every event on which a wait may depend; remaining: seconds until
    the awaited message is due, 0 if none is.
    """

    def __init__(self, rate: float = 1.0, paused: bool = False, now: Callable[[], float] = time.monotonic) -> None:
        self._rate, self._now = rate, now
        self._anchor: tuple[float, int] | None = None  # a clock time and the stamp that was due then
        self._paused = paused
        self._steps = 0
        self._stopped = False
        self._sought: float | None = None
        self.changed = threading.Condition()
        self.remaining = 0.0

    def pause(self) -> None:
        """Hold back everything not yet sent."""
        with self.changed:
            self._paused = True
            self._steps = 0
            self.changed.notify_all()

    def resume(self) -> None:
        """Continue from where the pause began; the time in pause is not caught up."""
        with self.changed:
            self._paused = False
            self.changed.notify_all()

    @property
    def paused(self) -> bool:
        with self.changed:
            return self._paused

    def step(self) -> bool:
        """Let one frame through; False, and nothing happens, if playback is not paused."""
        with self.changed:
            if not self._paused:
                return False
            self._steps += 1
            self.changed.notify_all()
            return True

    def wait_while_paused(self) -> None:
        """Wait until it is not paused, or is interrupted."""
        with self.changed:
            self.changed.wait_for(lambda: not self._paused or self.interrupted)

    def set_rate(self, rate: float) -> None:
        """Continue at another rate: seconds of the recording per second, as the constructor's argument."""
        with self.changed:
            self._rate, self._anchor = rate, None
            self.changed.notify_all()

    def seek(self, offset_s: float) -> None:
        """Interrupt, so that the playing thread can continue `offset_s` after the beginning; a pause stays."""
        with self.changed:
            self._sought = offset_s
            self.changed.notify_all()

    def take_seek(self) -> float | None:
        """Return, once, the position of a seek [s after the beginning]; None if there was none."""
        with self.changed:
            sought, self._sought = self._sought, None
            return sought

    @property
    def interrupted(self) -> bool:
        """True while a stop or a seek asks the playing thread to break off."""
        with self.changed:
            return self._stopped or self._sought is not None

    def stop(self) -> None:
        """End every wait, now and later."""
        with self.changed:
            self._stopped = True
            self.changed.notify_all()

    @property
    def stopped(self) -> bool:
        with self.changed:
            return self._stopped

    def rewind(self) -> None:
        """Prepare for stamps that start again from an earlier one."""
        with self.changed:
            self._anchor = None

    def wait_until_due(self, stamp_ns: int, on_tick: Callable[[int], None] | None = None, tick_s: float = 0.02) -> bool:
        """Wait until a message of this stamp may go out; False if playback was interrupted.

        While time passes `on_tick` is called every `tick_s` with the recorded time reached, in nanoseconds.
        """
        while True:
            with self.changed:
                if self.interrupted:
                    return False
                if self._paused:
                    if self._steps:
                        return True
                    self._anchor = None
                    self.changed.wait()
                    continue
                self.remaining = max(self._until(stamp_ns), 0.0)
                if self.remaining < _SOON_S:
                    return True
                self.changed.wait(min(self.remaining, tick_s))
                reached = self._reached()
            if on_tick is not None and reached is not None:
                on_tick(min(reached, stamp_ns))

    def _until(self, stamp_ns: int) -> float:
        """Return the seconds of the clock until a stamp [ns] is due; 0 or less if it is, as always at rate 0."""
        if self._rate == 0:
            return 0.0
        if self._anchor is None:
            self._anchor = (self._now(), stamp_ns)
        since, first = self._anchor
        return (stamp_ns - first) / SECOND / self._rate - (self._now() - since)

    def _reached(self) -> int | None:
        """Return the stamp [ns] that is due now; None before the first one after a pause, a new rate or a rewind."""
        if self._anchor is None:
            return None
        since, first = self._anchor
        return first + round((self._now() - since) * self._rate * SECOND)

    def frame_sent(self) -> None:
        """Note that a whole frame was sent: it uses up a step."""
        with self.changed:
            self._steps = max(0, self._steps - 1)

    def wait_for(self, done: Callable[[], bool], timeout_s: float) -> bool:
        """Wait until `done()`, checked whenever `changed` is notified; False after `timeout_s` or if interrupted."""
        with self.changed:
            self.changed.wait_for(lambda: self.interrupted or done(), timeout_s)
            return not self.interrupted and done()
