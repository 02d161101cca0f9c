"""Tells a jump of time, as of a looped bag, from single wrong stamps and from a second source of other times."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

# Stamps that run back by more than this may be a new run; by less, a message out of order.
JUMP_NS = 500_000_000
# While the time that is followed was heard of this lately [s], one that was left or dropped before is another source's.
_SPEAKS_S = 0.5


class Judgement(NamedTuple):
    """What becomes of codes, by stamp [ns].

    taken: stamps and payloads to be processed, in order; ran_back: whether time ran back to the first of them;
    odd: stamps of those that are dropped, one of which may have been taken before; late: whether the code asked about
    is one behind the newest, dropped as well; held: that it waits for a second witness.
    """

    taken: tuple[tuple[int, Any], ...] = ()
    ran_back: bool = False
    odd: tuple[int, ...] = ()
    late: bool = False
    held: bool = False


class Timeline:
    """The time that the codes of one sensor are of.

    A stamp further back than `JUMP_NS` is believed when a second witness tells of the same: the next code, or the
    transforms. One far ahead is taken at once, for a camera may have been still, but counts as wrong when the next code
    goes on from before it.
    When a time that was left or dropped goes on beside the present one, that is a second source and no jump.

    transforms: the newest stamp [ns] of the moving transforms, None without any. now: seconds.
    """

    def __init__(self, transforms: Callable[[], int | None], now: Callable[[], float]):
        self._transforms, self._now = transforms, now
        self._newest: int | None = None
        self._heard = 0.0
        self._leapt_from: int | None = None  # while the newest is far ahead of this and none has followed it
        self._held: tuple[int, Any] | None = None
        self._held_since = 0.0
        self._other: int | None = None  # newest stamp of a time that was left or dropped

    def judge(self, stamp: int, payload: Any) -> Judgement:
        """Ask about the next code, of `stamp` [ns]."""
        if self._of_another_source(stamp):
            self._other = stamp
            return Judgement(odd=(stamp,))
        if self._newest is None or stamp > self._newest:
            return self._go_on(stamp, payload)
        if self._leapt_from is not None and self._leapt_from < stamp < self._newest - JUMP_NS:
            return self._return(stamp, payload)
        if stamp >= self._newest - JUMP_NS:
            return Judgement(odd=self._drop_held(), late=True)
        if self._held is not None and stamp > self._held[0]:
            return self._jump((self._held, (stamp, payload)))
        odd = self._drop_held()
        self._held, self._held_since = (stamp, payload), self._now()
        return self.ask_again()._replace(odd=odd)

    def ask_again(self) -> Judgement:
        """Whether the transforms tell of the jump that a code waits with."""
        if self._held is None:
            return Judgement()
        told = self._transforms()
        if told is None or abs(told - self._held[0]) > abs(told - self._newest):
            return Judgement(held=True)
        return self._jump((self._held,))

    def give_up(self, seconds: float) -> Judgement:
        """Drop a code that has waited so long."""
        if self._held is None or self._now() - self._held_since < seconds:
            return Judgement()
        return Judgement(odd=self._drop_held())

    def _of_another_source(self, stamp: int) -> bool:
        if self._other is None or not 0 < stamp - self._other <= JUMP_NS:
            return False
        apart = abs(stamp - self._newest) > JUMP_NS
        return apart and self._now() - self._heard < _SPEAKS_S

    def _go_on(self, stamp: int, payload: Any) -> Judgement:
        leaps = self._newest is not None and stamp > self._newest + JUMP_NS
        if self._leapt_from is not None and not leaps:
            self._other = self._leapt_from  # the leap was none by mistake: what it left is over
        self._leapt_from = self._newest if leaps else None
        odd = self._drop_held()
        self._follow(stamp)
        return Judgement(((stamp, payload),), odd=odd)

    def _return(self, stamp: int, payload: Any) -> Judgement:
        """The newest was far ahead by mistake."""
        odd, self._other = (self._newest, *self._drop_held()), self._newest
        if stamp <= self._leapt_from + JUMP_NS:
            self._leapt_from = None
        self._follow(stamp)
        return Judgement(((stamp, payload),), odd=odd)

    def _jump(self, taken: tuple[tuple[int, Any], ...]) -> Judgement:
        self._other, self._held, self._leapt_from = self._newest, None, None
        self._follow(taken[-1][0])
        return Judgement(taken, ran_back=True)

    def _follow(self, stamp: int) -> None:
        self._newest, self._heard = stamp, self._now()

    def _drop_held(self) -> tuple[int, ...]:
        if self._held is None:
            return ()
        (self._other, _), self._held = self._held, None
        return (self._other,)
