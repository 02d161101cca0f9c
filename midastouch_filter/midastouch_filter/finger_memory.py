"""What one further finger felt lately, kept until frames of the reference ask for it.

Cameras run free, so that no two images have the same stamp. That costs nothing: the object rests, and each finger is
where TF says at the stamp of its own image.
"""

from __future__ import annotations

import dataclasses
from collections import OrderedDict
from collections.abc import Callable
from typing import Protocol

import numpy as np

from midastouch_common import se3
from midastouch_perception.sensor_model import SensorModel

from .core.touch import Measurement
from .localiser import LoadedObject
from .timeline import JUMP_NS
from .transforms.queue import Wait

# Live the next image comes within some 30 ms; a finger that is slower than this holds nobody up.
_PATIENCE = 0.25
_BEHIND_NS = round(1e9 * _PATIENCE)
_KEPT = 100  # codes


class Maps(Protocol):
    """Where the maps of a finger's codes are: `nodes.map_source.MapSource`."""

    def awaited(self, stamp: int, waited: float) -> bool: ...

    def take(self, stamp: int, sensor: SensorModel) -> np.ndarray | None: ...


class FingerMemory:
    """The last codes of one finger.

    place: T_base_finger (4, 4) at a stamp [ns], `Wait`, or None if it will never come. tolerance [ns]: how far the
    stamp of a code may be from the frame's. maps: None if they are not asked for. now: seconds by which the finger
    falls silent. on_foreign: told of the network of a code that the codebook does not know.
    """

    def __init__(
        self,
        place: Callable[[int], np.ndarray | Wait | None],
        tolerance: int,
        maps: Maps | None,
        now: Callable[[], float],
        on_foreign: Callable[[str], None],
    ):
        self._place, self._tolerance, self._maps = place, tolerance, maps
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
        """Forget what was felt, and since when nothing was."""
        self._codes.clear()
        self._newest = self._heard = self._unplaced = None
        self._asked, self._given_up = 0, False

    def rewind(self, stamp: int) -> None:
        """The reference's time ran back to `stamp` [ns]: forget what was felt before, but not what was felt since."""
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
        self._given_up &= stamp < self._asked - _BEHIND_NS
        self._codes[stamp] = measurement
        while len(self._codes) > _KEPT:
            self._codes.popitem(last=False)
        return True

    def awaited(self, stamp: int, waited: float) -> bool:
        """Whether its code for `stamp` [ns], or what belongs to it, may still come: for a short while only.

        When it or its transform was waited for in vain, nobody waits again before it has caught up.
        """
        self._asked = stamp
        patient = waited < _PATIENCE
        if self._newest is None or stamp - self._newest > _BEHIND_NS:
            return False
        if self._newest < stamp:
            self._given_up |= not patient
            return not self._given_up
        found = self._nearest(stamp)
        return found is not None and self._lacks(found, waited)

    def _lacks(self, found: int, waited: float) -> bool:
        """Whether the map or the transform of its code at `found` [ns] is still to come."""
        if self._codes[found].in_contact and self._maps is not None and self._maps.awaited(found, waited):
            return True
        if self._unplaced is not None and isinstance(self._place(self._unplaced), Wait):
            return False
        lacks = isinstance(self._place(found), Wait)
        self._unplaced = found if lacks and waited >= _PATIENCE else None
        return lacks and waited < _PATIENCE

    def take(self, stamp: int, T_base_gel: np.ndarray, on: LoadedObject | None) -> Measurement | str:
        """What it felt about `stamp` [ns], with the reference's gel at T_base_gel (4, 4), or in a word what is missing.

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
        T_base_finger = self._place(found)
        if not isinstance(T_base_finger, np.ndarray):
            return "missing_transform"
        if self._maps is not None and measurement.in_contact and on is not None and on.sensor is not None:
            measurement = dataclasses.replace(measurement, penetration=self._maps.take(found, on.sensor))
        return dataclasses.replace(measurement, T_gel_finger=se3.inverse(T_base_gel) @ T_base_finger)

    def _nearest(self, stamp: int) -> int | None:
        """Stamp of the code nearest to `stamp`, if it lies within the tolerance."""
        nearest = min(self._codes, key=lambda each: abs(each - stamp), default=None)
        return nearest if nearest is not None and abs(nearest - stamp) <= self._tolerance else None
