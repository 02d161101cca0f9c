"""Codes in time: jumps, as of a looped bag, distinguished from wrong stamps and from a second source; codes of further
fingers.

Cameras run free, so that no two images have the same stamp. That costs nothing: the object rests, and each finger is
where TF says at the stamp of its own image. So the codes of a further finger are kept until frames of the reference ask
for them.
"""

from __future__ import annotations

import dataclasses
from collections import OrderedDict
from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

import numpy as np

from midastouch_common import se3
from midastouch_perception.sensor_model import SensorModel

from .core.touch import Measurement
from .loaded_object import LoadedObject
from .transforms.queue import Wait

# Stamps that run back by more than this may be a new run; by less, a message out of order.
JUMP_NS = 500_000_000
# While the time that is followed was heard of this lately [s], one that was left or dropped before is another source's.
_SECOND_SOURCE_S = 0.5
# Live the next image comes within some 30 ms; a slower finger does not hold up the frame.
CODE_TIMEOUT = 0.25
"""s that what belongs to one frame is waited for, where messages may be lost."""
_CODE_TIMEOUT_NS = round(1e9 * CODE_TIMEOUT)
_KEPT_CODES = 100  # codes


class Judgement(NamedTuple):
    """What becomes of codes, by stamp [ns].

    taken: stamps and payloads to be processed, in order; ran_back: whether time ran back to the first of them;
    odd: stamps of codes that are dropped, or of a code taken before that turned out wrong; late: whether the new code
    is dropped because it is older than the newest; held: whether the new code waits until a second one confirms its
    time.
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
        """Judge the next code that has arrived, of `stamp` [ns]; payload, returned with the stamp once it is taken."""
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
        newest = self._transforms()
        if newest is None or abs(newest - self._held[0]) > abs(newest - self._newest):
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
        return apart and self._now() - self._heard < _SECOND_SOURCE_S

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


class Maps(Protocol):
    """Where the maps of a finger's codes are: `nodes.finger_topics.MapSource`."""

    def awaited(self, stamp: int, waited: float) -> bool: ...

    def take(self, stamp: int, sensor: SensorModel) -> np.ndarray | None: ...


class FingerMemory:
    """The last codes of one finger.

    pose_at: T_base_finger (4, 4) at a stamp [ns], `Wait`, or None if it will never come. tolerance [ns]: how far the
    stamp of a code may be from the frame's. maps: None if they are not asked for. now: clock [s] by which
    silence is measured. on_foreign: called with the network of a code that the codebook was not built with.
    """

    def __init__(
        self,
        pose_at: Callable[[int], np.ndarray | Wait | None],
        tolerance: int,
        maps: Maps | None,
        now: Callable[[], float],
        on_foreign: Callable[[str], None],
    ):
        self._pose_at, self._tolerance, self._maps = pose_at, tolerance, maps
        self._now, self._on_foreign = now, on_foreign
        self._heard: float | None = None  # when its last code came, or its first one was asked for
        self._codes: OrderedDict[int, Measurement] = OrderedDict()
        self._newest: int | None = None
        self._asked = 0
        self._given_up = False
        self._unplaced: int | None = None  # stamp of a code whose transform was waited for in vain

    @property
    def silence(self) -> float:
        """Seconds since its last code."""
        return 0.0 if self._heard is None else self._now() - self._heard

    def clear(self) -> None:
        """Forget what was measured, and since when nothing was."""
        self._codes.clear()
        self._newest = self._heard = self._unplaced = None
        self._asked, self._given_up = 0, False

    def rewind(self, stamp: int) -> None:
        """The reference's time ran back to `stamp` [ns]: forget what was measured before, but not what was measured
        since."""
        if self._newest is not None and self._newest > stamp + JUMP_NS:
            self.clear()
        self._asked = min(self._asked, stamp)

    def add(self, stamp: int, measurement: Measurement) -> bool:
        """One more code of `stamp` [ns]; False if it or a later one was here before."""
        if self._newest is not None and stamp <= self._newest - JUMP_NS:
            self.clear()
        self._heard = self._now()
        if self._newest is not None and stamp <= self._newest:
            return False
        self._newest = stamp
        self._given_up &= stamp < self._asked - _CODE_TIMEOUT_NS
        self._codes[stamp] = measurement
        while len(self._codes) > _KEPT_CODES:
            self._codes.popitem(last=False)
        return True

    def awaited(self, stamp: int, waited: float) -> bool:
        """Whether a frame at `stamp` [ns] that has waited for `waited` s shall go on waiting for this finger's code, or
        for its map or transform: at most a quarter of a second.

        After a wait in vain, further frames do not wait for this finger until it has caught up.
        """
        self._asked = stamp
        in_time = waited < CODE_TIMEOUT
        if self._newest is None or stamp - self._newest > _CODE_TIMEOUT_NS:
            return False
        if self._newest < stamp:
            self._given_up |= not in_time
            return not self._given_up
        found = self._nearest(stamp)
        return found is not None and self._lacks(found, waited)

    def _lacks(self, found: int, waited: float) -> bool:
        """Whether the map or the transform of its code at `found` [ns] is still to come."""
        if self._codes[found].in_contact and self._maps is not None and self._maps.awaited(found, waited):
            return True
        if self._unplaced is not None and isinstance(self._pose_at(self._unplaced), Wait):
            return False
        lacks = isinstance(self._pose_at(found), Wait)
        self._unplaced = found if lacks and waited >= CODE_TIMEOUT else None
        return lacks and waited < CODE_TIMEOUT

    def take(self, stamp: int, T_base_gel: np.ndarray, on: LoadedObject | None) -> Measurement | str:
        """What it measured about `stamp` [ns], with the reference's gel at T_base_gel (4, 4), or in a word what is
        missing.

        Each of its codes is given out once.
        """
        if self._heard is None:
            self._heard = self._now()
        found = self._nearest(stamp)
        if found is None:
            return "missing_code"
        measurement = self._codes[found]
        while self._codes and next(iter(self._codes)) <= found:
            self._codes.popitem(last=False)
        if on is not None and on.network_id and measurement.network_id not in ("", on.network_id):
            self._on_foreign(f"from network {measurement.network_id}, not the codebook's {on.network_id}")
            return "foreign_code"
        T_base_finger = self._pose_at(found)
        if not isinstance(T_base_finger, np.ndarray):
            return "missing_transform"
        if self._maps is not None and measurement.in_contact and on is not None and on.sensor is not None:
            measurement = dataclasses.replace(measurement, penetration=self._maps.take(found, on.sensor))
        return dataclasses.replace(measurement, T_gel_finger=se3.inverse(T_base_gel) @ T_base_finger)

    def _nearest(self, stamp: int) -> int | None:
        """Stamp of the code nearest to `stamp`, if it lies within the tolerance."""
        nearest = min(self._codes, key=lambda each: abs(each - stamp), default=None)
        return nearest if nearest is not None and abs(nearest - stamp) <= self._tolerance else None
