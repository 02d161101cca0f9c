"""Further fingers on the same object: their codes and maps, joined with the reference's frames."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable

import numpy as np
from rclpy.node import Node

from midastouch_common.errors import InputError
from midastouch_common.message_arrays import stamp_ns
from midastouch_common.ros import qos
from midastouch_common.ros.parameters import Parameters
from midastouch_msgs.msg import TactileCode

from ..core.perceived import measurement_from_msg
from ..core.touch import Measurement
from ..finger_memory import FingerMemory
from ..localiser import LoadedObject
from ..transforms import TransformError
from ..transforms.queue import Wait
from .map_source import MapSource

_FINGER = re.compile(r"\s*(/?[A-Za-z]\w*(?:/[A-Za-z]\w*)*)\s*:\s*([^\s:,]+)\s*", re.ASCII)


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

    lookup: as `TransformSource.lookup`. now: seconds by which a finger falls silent. on_update: called after every
    message, so that whoever waits can ask again. on_bad(kind, reason): told of what cannot be used. Attributes: counts,
    of frames that each finger missed, by reason and name.
    """

    def __init__(
        self,
        node: Node,
        parameters: Parameters,
        maps: bool,
        lookup: Callable[[str, str, int], np.ndarray | Wait],
        now: Callable[[], float],
        on_update: Callable[[], None],
        on_bad: Callable[[str, str], None],
    ):
        self.counts: Counter[str] = Counter()
        self._node, self._parameters, self._maps, self._lookup = node, parameters, maps, lookup
        self._now, self._on_update, self._on_bad = now, on_update, on_bad
        self._fingers = {name: self._listen(name, frame) for name, frame in fingers_of(parameters).items()}
        self._silent: list[str] = []

    def _listen(self, name: str, frame: str) -> FingerMemory:
        """Subscribe what a finger feels."""
        depth, reliable = self._parameters["queue_depth"], self._parameters["reliable"]
        base = self._parameters["base_frame_id"]
        maps = None
        if self._maps:
            maps = MapSource(
                self._node,
                depth,
                reliable,
                on_cloud=self._on_update,
                on_bad=lambda reason: self._on_bad("bad_clouds", reason),
                topic=f"{name}/tactile/points",
            )

        def place(stamp: int) -> np.ndarray | Wait | None:
            try:
                return self._lookup(base, frame, stamp)
            except (TransformError, InputError):
                return None

        def on_foreign(reason: str) -> None:
            self._on_bad("bad_codes", f"{name}/tactile/code: {reason}")

        tolerance = round(1e9 * self._parameters["finger_tolerance"])
        memory = FingerMemory(place, tolerance, maps, self._now, on_foreign)

        def on_code(msg: TactileCode) -> None:
            if memory.add(stamp_ns(msg.header.stamp), measurement_from_msg(msg)):
                self._on_update()

        profile = qos.stage_subscriber(max(depth, 10), reliable)
        self._node.create_subscription(TactileCode, f"{name}/tactile/code", on_code, profile)
        return memory

    def awaited(self, stamp: int, waited: float) -> bool:
        """Whether what a finger felt at `stamp` [ns] may still come, when the frame has `waited` seconds."""
        waiting = [finger.awaited(stamp, waited) for finger in self._fingers.values()]  # all: each gives up by itself
        return any(waiting)

    def take(self, stamp: int, T_base_gel: np.ndarray, on: LoadedObject | None) -> dict[str, Measurement]:
        """What the fingers feel at `stamp` [ns], by name, with the reference's gel at T_base_gel (4, 4)."""
        found = {}
        for name, finger in self._fingers.items():
            touch = finger.take(stamp, T_base_gel, on)
            if isinstance(touch, str):
                self.counts[f"{touch} of {name}"] += 1
            else:
                found[name] = touch
        return found

    def qualify(self, reason: str) -> str:
        """A reason that names the fingers that have been silent for long; each is reported when it falls silent."""
        timeout = self._parameters["input_timeout"]
        silent = [name for name, finger in self._fingers.items() if finger.silence > timeout]
        for name in set(silent) - set(self._silent):
            self._on_bad("silent_fingers", f"no {name}/tactile/code for {timeout:.1f} s: going on without it")
        self._silent = silent
        return f"{reason}; without {', '.join(silent)}" if silent else reason

    def clear(self) -> None:
        """Forget what was felt, and since when nothing was: the object was changed."""
        for finger in self._fingers.values():
            finger.clear()

    def rewind(self, stamp: int) -> None:
        """The reference's time ran back to `stamp` [ns]: forget what was felt before, but not what fingers that were
        quicker have felt since."""
        for finger in self._fingers.values():
            finger.rewind(stamp)
