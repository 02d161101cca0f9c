"""Topics of the fingers: the penetration map of a code, and codes and maps of further fingers on the same object."""

from __future__ import annotations

import re
from collections import Counter, OrderedDict
from collections.abc import Callable

import numpy as np
from rclpy.node import Node
from sensor_msgs.msg import PointCloud2

from midastouch_common.errors import InputError
from midastouch_common.message_arrays import points_from_msg, stamp_ns
from midastouch_common.ros import qos
from midastouch_common.ros.parameters import Parameters
from midastouch_common.transforms.queue import Wait
from midastouch_common.transforms.rigid import TransformError
from midastouch_msgs.msg import TactileCode
from midastouch_perception.pointcloud import penetration_from_cloud
from midastouch_perception.sensor_model import SensorModel

from ..core.touch import Measurement, measurement_from_msg, reduced_penetration
from ..loaded_object import LoadedObject
from ..timeline import CODE_TIMEOUT, RELIABLE_TIMEOUT, FingerMemory

_FINGER = re.compile(r"\s*(/?[A-Za-z]\w*(?:/[A-Za-z]\w*)*)\s*:\s*([^\s:,]+)\s*", re.ASCII)
# The code is made from the cloud, so the cloud comes first or, if it is overtaken, at once; otherwise it was lost.
CLOUD_TIMEOUT = CODE_TIMEOUT
"""Longest wait [s] for a cloud, if messages may be lost."""
# Clouds that wait with codes whose transforms are late: over 4 s at 60 Hz.
_KEPT_CLOUDS = 256


def fingers_of(parameters: Parameters) -> dict[str, str]:
    """Return the gel frame of each further finger by namespace; raises InputError on a malformed `fingers`, and if a
    gripper has none."""
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
    if parameters["gripper_frame_id"] and not found:
        raise InputError("parameter 'gripper_frame_id': a gripper has two sensors or more; name the others in fingers")
    return found


class FingerTopics:
    """All further fingers of one node.

    lookup: as `TransformSource.lookup`. now: clock [s] that measures a finger's silence. on_update: called after every
    message, so that waiting frames can ask again. on_bad(kind, reason): called for input that cannot be used.
    Attributes: counts of frames that each finger missed, by reason and name.
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
        """Subscribe to a finger's topics and return its memory."""
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

        def pose_at(stamp: int) -> np.ndarray | Wait | None:
            try:
                return self._lookup(base, frame, stamp)
            except (TransformError, InputError):
                return None

        def on_foreign(reason: str) -> None:
            self._on_bad("bad_codes", f"{name}/tactile/code: {reason}")

        timeout = RELIABLE_TIMEOUT if reliable else CODE_TIMEOUT
        memory = FingerMemory(pose_at, maps, self._now, on_foreign, timeout)

        def on_code(msg: TactileCode) -> None:
            if memory.add(stamp_ns(msg.header.stamp), measurement_from_msg(msg)):
                self._on_update()

        profile = qos.stage_subscriber(max(depth, 10), reliable)
        self._node.create_subscription(TactileCode, f"{name}/tactile/code", on_code, profile)
        return memory

    def awaited(self, stamp: int, waited: float) -> bool:
        """Return whether a finger's measurement at `stamp` [ns] may still come, after the frame `waited` seconds."""
        waiting = [finger.awaited(stamp, waited) for finger in self._fingers.values()]  # all of them: each gives up
        return any(waiting)

    def take(self, stamp: int, T_base_gel: np.ndarray, on: LoadedObject | None) -> dict[str, Measurement]:
        """Return the fingers' measurements at `stamp` [ns], by name, with the reference's gel at T_base_gel (4, 4)."""
        found = {}
        for name, finger in self._fingers.items():
            touch = finger.take(stamp, T_base_gel, on)
            if isinstance(touch, str):
                self.counts[f"{touch} of {name}"] += 1
            else:
                found[name] = touch
        return found

    def qualify(self, reason: str) -> str:
        """Add to a reason the fingers that have long been silent; each one is reported when it falls silent."""
        timeout = self._parameters["input_timeout"]
        silent = [name for name, finger in self._fingers.items() if finger.silence > timeout]
        for name in set(silent) - set(self._silent):
            self._on_bad("silent_fingers", f"no {name}/tactile/code for {timeout:.1f} s: going on without it")
        self._silent = silent
        return f"{reason}; without {', '.join(silent)}" if silent else reason

    def clear(self) -> None:
        """Forget all codes, and how long none has come, because the object was changed."""
        for finger in self._fingers.values():
            finger.clear()

    def rewind(self, stamp: int) -> None:
        """Follow the reference's time back to `stamp` [ns]: forget codes from before the jump, but keep those that
        quicker fingers have sent since."""
        for finger in self._fingers.values():
            finger.rewind(stamp)


class MapSource:
    """Last clouds of a topic, kept until their codes ask for them.

    on_cloud: called after every cloud, so that waiting codes can ask again. on_bad: called with a reason for each
    cloud that cannot be used. While no node publishes clouds, nothing waits for them, except with `reliable`: then no
    cloud may be lost, and the first code waits until a publisher is discovered.
    """

    def __init__(
        self,
        node: Node,
        depth: int,
        reliable: bool,
        on_cloud: Callable[[], None],
        on_bad: Callable[[str], None],
        topic: str = "tactile/points",
    ):
        self._topic = topic
        self._timeout = RELIABLE_TIMEOUT if reliable else CLOUD_TIMEOUT
        self._undiscovered = reliable  # codes can come before a publisher of clouds, and its latched clouds, are known
        self._node, self._on_cloud, self._on_bad = node, on_cloud, on_bad
        self._clouds: OrderedDict[int, PointCloud2] = OrderedDict()
        # Live, one code waits at a time, but the clouds of its successors may already be there.
        profile = qos.stage_subscriber(max(depth, 10), reliable)
        node.create_subscription(PointCloud2, topic, self._on_points, profile)

    def awaited(self, stamp: int, waited: float) -> bool:
        """Return whether the cloud of `stamp` [ns] is still to come, after `waited` seconds.

        Clouds come in order: one whose successor is there was lost.
        """
        if stamp in self._clouds:
            return False
        if waited >= self._timeout:
            self._undiscovered = False
            return False
        if self._clouds and next(reversed(self._clouds)) > stamp:
            return False
        return self._undiscovered or self._node.count_publishers(self._topic) > 0

    def take(self, stamp: int, sensor: SensorModel) -> np.ndarray | None:
        """Return the penetration map (80, 60) float32 [m] at `stamp` [ns]; None if its cloud is lost.

        sensor: at map resolution. Older clouds are forgotten, because codes are answered in order.
        """
        cloud = self._clouds.pop(stamp, None)
        while self._clouds and next(iter(self._clouds)) < stamp:
            self._clouds.popitem(last=False)
        if cloud is None:
            return None
        try:
            return reduced_penetration(penetration_from_cloud(points_from_msg(cloud), sensor))
        except InputError as error:
            self._on_bad(f"{self._topic}: {error}")
            return None

    def _on_points(self, msg: PointCloud2) -> None:
        stamp = stamp_ns(msg.header.stamp)
        if self._clouds and stamp < next(reversed(self._clouds)):
            self._clouds.clear()  # time ran backwards: a looped bag
        self._clouds[stamp] = msg
        while len(self._clouds) > _KEPT_CLOUDS:
            self._clouds.popitem(last=False)
        self._on_cloud()
