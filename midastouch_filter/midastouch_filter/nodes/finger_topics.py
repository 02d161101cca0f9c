"""Further fingers on the same object: their codes and reliefs, joined with the reference's frames.

Cameras run free, so that no two images have the same stamp. That costs nothing: the object rests, and each finger is
where TF says at the stamp of its own image.
"""

from __future__ import annotations

import dataclasses
import re
from collections import Counter, OrderedDict
from collections.abc import Callable

import numpy as np
from rclpy.node import Node

from midastouch_msgs.msg import TactileCode
from midastouch_perception import se3
from midastouch_perception.errors import InputError
from midastouch_perception.ros import qos
from midastouch_perception.ros.conversions import stamp_ns
from midastouch_perception.ros.parameters import Parameters

from ..touch import Measurement
from ..transforms import TransformError
from .code_message import measurement_from_msg
from .localiser import LoadedObject
from .relief_source import ReliefSource
from .transform_source import TransformSource, Wait

_FINGER = re.compile(r"\s*(/?[A-Za-z]\w*(?:/[A-Za-z]\w*)*)\s*:\s*([^\s:,]+)\s*", re.ASCII)
# Live the next image comes within some 30 ms; a finger that is slower than this holds nobody up.
_PATIENCE = 0.25
_BEHIND_NS = 250_000_000
# Stamps that run back by more than this are a new run (a looped bag).
_JUMP_NS = 500_000_000
_KEPT = 100  # codes


def fingers_of(parameters: Parameters) -> dict[str, str]:
    """Gel frame of each further finger by its namespace; InputError if the parameter `fingers` says something else."""
    given = parameters["fingers"]
    found: dict[str, str] = {}
    for part in given.split(",") if given.strip() else []:
        match = _FINGER.fullmatch(part)
        if match is None:
            raise InputError(
                f"parameter 'fingers': '{part}' is not NAMESPACE:GEL_FRAME, e.g. /right:right_digit_gel_frame"
            )
        namespace, frame = match.groups()
        if namespace in found or frame in (*found.values(), parameters["sensor_frame_id"]):
            raise InputError(f"parameter 'fingers': '{part.strip()}' is there twice, or is the filter's own sensor")
        found[namespace] = frame
    return found


class FingerTopics:
    """All further fingers of one node.

    now: seconds by which a finger falls silent. on_update: called after every message, so that whoever waits can ask
    again. on_bad(kind, reason): told of what cannot be used. Attributes: counts, of frames that each finger missed, by
    reason and name.
    """

    def __init__(
        self,
        node: Node,
        parameters: Parameters,
        reliefs: bool,
        transforms: TransformSource,
        now: Callable[[], float],
        on_update: Callable[[], None],
        on_bad: Callable[[str, str], None],
    ):
        self.counts: Counter[str] = Counter()
        self._on_bad = on_bad
        self._timeout = lambda: parameters["input_timeout"]
        self._fingers = [
            _Finger(node, parameters, name, frame, reliefs, transforms, now, on_update, on_bad)
            for name, frame in fingers_of(parameters).items()
        ]
        self._silent: list[str] = []

    def awaited(self, stamp: int, waited: float) -> bool:
        """Whether what a finger felt at `stamp` [ns] may still come, when the frame has `waited` seconds."""
        waiting = [finger.awaited(stamp, waited) for finger in self._fingers]  # all: each gives up by itself
        return any(waiting)

    def take(self, stamp: int, T_base_gel: np.ndarray, on: LoadedObject | None) -> dict[str, Measurement]:
        """What the fingers feel at `stamp` [ns], by name, with the reference's gel at T_base_gel (4, 4)."""
        found = {}
        for finger in self._fingers:
            touch = finger.take(stamp, T_base_gel, on)
            if isinstance(touch, str):
                self.counts[f"{touch} of {finger.name}"] += 1
            else:
                found[finger.name] = touch
        return found

    def qualify(self, reason: str) -> str:
        """A reason that names the fingers that have been silent for long; each is reported when it falls silent."""
        silent = [finger.name for finger in self._fingers if finger.silence > self._timeout()]
        for name in set(silent) - set(self._silent):
            self._on_bad("silent_fingers", f"no {name}/tactile/code for {self._timeout():.1f} s: going on without it")
        self._silent = silent
        return f"{reason}; without {', '.join(silent)}" if silent else reason

    def clear(self) -> None:
        """Forget what was felt, and since when nothing was: the object was changed."""
        for finger in self._fingers:
            finger.clear()

    def rewind(self, stamp: int) -> None:
        """The reference's time ran back to `stamp` [ns]: forget what was felt before, but not what fingers that were
        quicker have felt since."""
        for finger in self._fingers:
            finger.rewind(stamp)


class _Finger:
    """Keeps the last codes of one finger until frames of the reference ask for them."""

    def __init__(
        self,
        node: Node,
        parameters: Parameters,
        name: str,
        frame: str,
        reliefs: bool,
        transforms: TransformSource,
        now: Callable[[], float],
        on_update: Callable[[], None],
        on_bad: Callable[[str, str], None],
    ):
        self.name = name
        self._frame, self._base = frame, parameters["base_frame_id"]
        self._tolerance = round(1e9 * parameters["finger_tolerance"])
        self._transforms, self._now, self._on_update, self._on_bad = transforms, now, on_update, on_bad
        self._heard: float | None = None  # when its last code came, or its first one was asked for
        self._codes: OrderedDict[int, Measurement] = OrderedDict()
        self._newest: int | None = None
        self._asked = 0
        self._given_up = False
        self._unplaced: int | None = None  # stamp of a code whose transform was waited for in vain
        depth, reliable = parameters["queue_depth"], parameters["reliable"]
        self._reliefs: ReliefSource | None = None
        if reliefs:
            self._reliefs = ReliefSource(
                node,
                depth,
                reliable,
                on_cloud=on_update,
                on_bad=lambda reason: on_bad("bad_clouds", reason),
                topic=f"{name}/tactile/points",
            )
        profile = qos.stage_subscriber(max(depth, 10), reliable)
        node.create_subscription(TactileCode, f"{name}/tactile/code", self._on_code, profile)

    @property
    def silence(self) -> float:
        """Seconds since its last code."""
        return 0.0 if self._heard is None else self._now() - self._heard

    def clear(self) -> None:
        self._codes.clear()
        self._newest = self._heard = self._unplaced = None
        self._asked, self._given_up = 0, False

    def rewind(self, stamp: int) -> None:
        if self._newest is not None and self._newest > stamp + _JUMP_NS:
            self.clear()
        self._asked = min(self._asked, stamp)

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
        """Whether the relief or the transform of its code at `found` [ns] is still to come."""
        if self._codes[found].in_contact and self._reliefs is not None and self._reliefs.awaited(found, waited):
            return True
        if self._unplaced is not None and isinstance(self._place(self._unplaced), Wait):
            return False
        lacks = isinstance(self._place(found), Wait)
        self._unplaced = found if lacks and waited >= _PATIENCE else None
        return lacks and waited < _PATIENCE

    def _place(self, stamp: int) -> np.ndarray | Wait | None:
        """T_base_finger (4, 4) at `stamp` [ns]; None if it will never come."""
        try:
            return self._transforms.lookup(self._base, self._frame, stamp)
        except (TransformError, InputError):
            return None

    def take(self, stamp: int, T_base_gel: np.ndarray, on: LoadedObject | None) -> Measurement | str:
        """What it felt about `stamp` [ns], or in a word what is missing. Each of its codes is given out once."""
        if self._heard is None:
            self._heard = self._now()
        found = self._nearest(stamp)
        if found is None:
            return "missing_code"
        measurement = self._codes[found]
        while self._codes and next(iter(self._codes)) <= found:
            self._codes.popitem(last=False)
        if on is not None and on.network_id and measurement.network_id not in ("", on.network_id):
            self._on_bad(
                "bad_codes",
                f"{self.name}/tactile/code: from network {measurement.network_id}, not the codebook's {on.network_id}",
            )
            return "foreign_code"
        T_base_finger = self._place(found)
        if not isinstance(T_base_finger, np.ndarray):
            return "missing_transform"
        if self._reliefs is not None and measurement.in_contact and on is not None and on.sensor is not None:
            measurement = dataclasses.replace(measurement, penetration=self._reliefs.take(found, on.sensor))
        return dataclasses.replace(measurement, T_gel_finger=se3.inverse(T_base_gel) @ T_base_finger)

    def _nearest(self, stamp: int) -> int | None:
        """Stamp of the code nearest to `stamp`, if it lies within the tolerance."""
        nearest = min(self._codes, key=lambda each: abs(each - stamp), default=None)
        return nearest if nearest is not None and abs(nearest - stamp) <= self._tolerance else None

    def _on_code(self, msg: TactileCode) -> None:
        stamp = stamp_ns(msg.header.stamp)
        if self._newest is not None and stamp <= self._newest - _JUMP_NS:
            self.clear()
        self._heard = self._now()
        if self._newest is not None and stamp <= self._newest:
            return
        self._newest = stamp
        self._given_up &= stamp < self._asked - _BEHIND_NS
        self._codes[stamp] = measurement_from_msg(msg)
        while len(self._codes) > _KEPT:
            self._codes.popitem(last=False)
        self._on_update()
