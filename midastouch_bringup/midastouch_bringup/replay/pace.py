"""Which recorded time is due at which moment."""

from __future__ import annotations

from collections.abc import Callable

_SECOND = 1_000_000_000


class Pace:
    """Recorded time that runs at `rate` seconds per second of the clock `now`; at rate 0 everything is due."""

    def __init__(self, rate: float, now: Callable[[], float]) -> None:
        self._rate, self._now = rate, now
        self._anchor: tuple[float, int] | None = None  # a clock time and the stamp that was due then

    def restart(self) -> None:
        """The next stamp is due when it is asked for, whatever came before."""
        self._anchor = None

    def set_rate(self, rate: float) -> None:
        """Go on at another rate, from the next stamp."""
        self._rate, self._anchor = rate, None

    def remaining(self, stamp_ns: int) -> float:
        """Seconds of the clock until a stamp [ns] is due; not above 0 when it is."""
        if self._rate == 0:
            return 0.0
        if self._anchor is None:
            self._anchor = (self._now(), stamp_ns)
        since, first = self._anchor
        return (stamp_ns - first) / _SECOND / self._rate - (self._now() - since)

    def reached(self) -> int | None:
        """The stamp [ns] that is due now; None after a restart."""
        if self._anchor is None:
            return None
        since, first = self._anchor
        return first + round((self._now() - since) * self._rate * _SECOND)
