"""Times of codes: jumps (a looped bag), wrong stamps and second sources of one sensor; codes of further fingers.

Cameras are not synchronised, so no two images have the same stamp. That costs nothing: the object rests, and TF gives
each finger's pose at the stamp of its own image. So the codes of a further finger are kept until frames of the
reference sensor ask for them.
"""

from __future__ import annotations

import dataclasses
from collections import OrderedDict
from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

import numpy as np

from midastouch_common import se3
from midastouch_common.transforms.queue import Wait
from midastouch_perception.sensor_model import SensorModel

from .core.touch import Measurement
from .loaded_object import LoadedObject

# A stamp that is older than the newest by more than this may begin a new run; by less, it is out of order.
JUMP_NS = 500_000_000
# If a code of the time that is followed came within this [s], a code of a time that was left is of another source.
_SECOND_SOURCE_S = 0.5
# Live the next image comes within some 30 ms; a slower finger does not hold up the frame.
CODE_TIMEOUT = 0.25
"""Longest wait [s] for the parts of one frame, if messages may be lost."""
RELIABLE_TIMEOUT = 5.0
"""The same if none is lost: only a busy machine can delay one."""
_KEPT_CODES = 100
# Most that the stamps of a frame and a further finger's code may differ: one and a half images at 30 Hz.
_TOLERANCE_NS = 50_000_000


class Judgement(NamedTuple):
    """Decision on codes, by stamp [ns].

    taken: stamps and payloads to process, in order; ran_back: whether time ran back to the first of them;
    odd: stamps of codes that are dropped, or of an earlier code that turned out wrong; late: whether the new code
    is dropped because it is no newer than the newest; held: whether the new code waits until a second one confirms its
    time.
    """

    taken: tuple[tuple[int, Any], ...] = ()
    ran_back: bool = False
    odd: tuple[int, ...] = ()
    late: bool = False
    held: bool = False


class Timeline:
    """Time that the codes of one sensor follow.

    A stamp further back than `JUMP_NS` is believed once a second witness confirms it: the next code, or the transforms.
    A stamp far ahead is taken at once, because a camera may have been still, but counts as wrong if the next code
    continues from before it. If a time that was left or dropped continues in parallel to the present one, it is a
    second source and not a jump.

    Parameters
    ----------
    transforms
        Returns the newest stamp [ns] of the moving transforms, None without any.
    now
        Returns seconds.
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
        """Judge a code that has just come.

        Parameters
        ----------
        stamp : [ns]
        payload
            Once taken, it is returned with its stamp.
        """
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
        """Judge the held code again: it is taken if the transforms have made the same jump."""
        if self._held is None:
            return Judgement()
        newest = self._transforms()
        if newest is None or abs(newest - self._held[0]) > abs(newest - self._newest):
            return Judgement(held=True)
        return self._jump((self._held,))

    def give_up(self, seconds: float) -> Judgement:
        """Drop the held code if it has waited for `seconds`."""
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
            self._other = self._leapt_from  # the leap was no mistake: the time before it is over
        self._leapt_from = self._newest if leaps else None
        odd = self._drop_held()
        self._follow(stamp)
        return Judgement(((stamp, payload),), odd=odd)

    def _return(self, stamp: int, payload: Any) -> Judgement:
        """Take a code from before the newest one, which was far ahead by mistake."""
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
    """Source of the maps of a finger's codes: `nodes.finger_topics.MapSource`."""

    def awaited(self, stamp: int, waited: float) -> bool: ...

    def take(self, stamp: int, sensor: SensorModel) -> np.ndarray | None: ...


class FingerMemory:
    """Last codes of one finger.

    Parameters
    ----------
    pose_at
        Returns T_base_finger (4, 4) at a stamp [ns], `Wait`, or None if it will never come.
    maps
        None if they are not wanted.
    now : clock [s] that measures silence
    on_foreign
        Called with a reason if a code is of another network than the codebook.
    timeout : [s]
        Longest wait for a code or its transform.
    """

    def __init__(
        self,
        pose_at: Callable[[int], np.ndarray | Wait | None],
        maps: Maps | None,
        now: Callable[[], float],
        on_foreign: Callable[[str], None],
        timeout: float,
    ):
        self._timeout, self._timeout_ns = timeout, round(1e9 * timeout)
        self._pose_at, self._maps = pose_at, maps
        self._now, self._on_foreign = now, on_foreign
        self._heard: float | None = None  # time of its last code, or of the first frame that asked for one
        self._codes: OrderedDict[int, Measurement] = OrderedDict()
        self._newest: int | None = None
        self._asked = 0
        self._given_up = False
        self._unplaced: int | None = None  # stamp of a code whose transform did not come in time

    @property
    def silence(self) -> float:
        """Seconds since its last code."""
        return 0.0 if self._heard is None else self._now() - self._heard

    def clear(self) -> None:
        """Forget all codes, and how long none has come."""
        self._codes.clear()
        self._newest = self._heard = self._unplaced = None
        self._asked, self._given_up = 0, False

    def rewind(self, stamp: int) -> None:
        """Follow the reference's time back to `stamp` [ns]: forget codes from before the jump, keep those since."""
        if self._newest is not None and self._newest > stamp + JUMP_NS:
            self.clear()
        self._asked = min(self._asked, stamp)

    def add(self, stamp: int, measurement: Measurement) -> bool:
        """Add a code; return False if it or a later one has come before.

        Parameters
        ----------
        stamp : [ns]
        measurement
        """
        if self._newest is not None and stamp <= self._newest - JUMP_NS:
            self.clear()
        self._heard = self._now()
        if self._newest is not None and stamp <= self._newest:
            return False
        self._newest = stamp
        self._given_up &= stamp < self._asked - self._timeout_ns
        self._codes[stamp] = measurement
        while len(self._codes) > _KEPT_CODES:
            self._codes.popitem(last=False)
        return True

    def awaited(self, stamp: int, waited: float) -> bool:
        """Return whether a frame should wait on for this finger.

        It waits for its code or transform at most its timeout, for its map as long as `maps` waits. After a code did
        not come in time, further frames do not wait for this finger until it has caught up.

        Parameters
        ----------
        stamp : [ns], of the frame
        waited : [s]
        """
        self._asked = stamp
        in_time = waited < self._timeout
        if self._newest is None or stamp - self._newest > self._timeout_ns:
            return False
        if self._newest < stamp:
            self._given_up |= not in_time
            return not self._given_up
        found = self._nearest(stamp)
        return found is not None and self._lacks(found, waited)

    def _lacks(self, found: int, waited: float) -> bool:
        """Return whether the map or the transform of its code at `found` [ns] is still to come."""
        if self._codes[found].in_contact and self._maps is not None and self._maps.awaited(found, waited):
            return True
        if self._unplaced is not None and isinstance(self._pose_at(self._unplaced), Wait):
            return False
        lacks = isinstance(self._pose_at(found), Wait)
        self._unplaced = found if lacks and waited >= self._timeout else None
        return lacks and waited < self._timeout

    def take(self, stamp: int, T_base_gel: np.ndarray, on: LoadedObject | None) -> Measurement | str:
        """Return its measurement near a frame, or one word for what is missing. Each code is returned once.

        Parameters
        ----------
        stamp : [ns], of the frame
        T_base_gel : (4, 4), the reference's gel
        on
            The object that the filter runs on.
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
        """Return the stamp of the code nearest to `stamp`, if it lies within the tolerance."""
        nearest = min(self._codes, key=lambda each: abs(each - stamp), default=None)
        return nearest if nearest is not None and abs(nearest - stamp) <= _TOLERANCE_NS else None
