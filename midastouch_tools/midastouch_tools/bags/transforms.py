"""All transforms of a bag, in any recorded order."""

from __future__ import annotations

import math
import sys
from bisect import bisect_left
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from midastouch_common.errors import InputError
from midastouch_common.message_arrays import stamp_ns, xyzquat_from_msg
from midastouch_common.transforms.rigid import IDENTITY, Pose, TransformError, interpolate, invert, multiply, to_matrix
from midastouch_common.transforms.tree import FrameTree

from ..text_table import counted
from .messages import TF_STATIC_TOPIC, TF_TOPIC
from .reader import bag_messages, content_of

_LATEST_NS = 1_000_000_000  # largest delay of a transform behind those recorded before it


class _Track:
    """Stamps of one frame's transforms in recorded order.

    A late transform is sorted in by its stamp, unless it is late by more than `_LATEST_NS`. The frame's time runs
    backwards if its stamps cover more than that span a second time, as in a looped bag. Attributes: left_out, number of
    transforms; jump: stamp [ns] at which time first ran backwards.
    """

    def __init__(self) -> None:
        self.left_out = 0
        self.jump: float | None = None
        self._newest = self._again_from = -math.inf

    def too_late(self, stamp: int) -> bool:
        return stamp < self._newest - _LATEST_NS

    def add(self, stamp: int, is_used: bool) -> None:
        """Take note of the next valid transform."""
        self.left_out += not is_used
        if stamp > self._newest:
            self._newest, self._again_from = stamp, math.inf
            return
        self._again_from = min(stamp, self._again_from)
        if self.jump is None and stamp - self._again_from > _LATEST_NS:
            self.jump = self._again_from


class RecordedTransforms(FrameTree):
    """Tree of frames with all poses of a recording, however long; it interpolates and composes as tf2 does.

    tf2 itself is part of ROS, which reading a bag does not need.
    """

    def __init__(self) -> None:
        super().__init__()
        self._links: dict[str, _Link] = {}

    def insert(self, parent: str, child: str, stamp: int, pose: Sequence[float], static: bool = False) -> bool:
        """Store [x y z qx qy qz qw] (m) at `stamp` [ns], or for ever; return False if there is another at this stamp.

        A child that changes its parent starts again. Raises TransformError as `link` does.
        """
        valid, link = self.link(parent, child, pose), self._links.get(child)
        if link is None or link.parent != parent or static or link.static:
            link = self._links[child] = _Link(parent, static)
        at = bisect_left(link.stamps, stamp)
        if link.stamps[at : at + 1] == [stamp]:
            return bool(np.array_equal(link.poses[at], valid))
        link.stamps.insert(at, stamp)
        link.poses.insert(at, valid)
        return True

    def lookup(self, target: str, source: str, stamp: int) -> np.ndarray:
        """Return T_target_source (4, 4) at `stamp` [ns]; raises TransformError if the recording does not give it."""
        ends = target.lstrip("/"), source.lstrip("/")
        ways = [self.ancestors(end) for end in ends]
        common = next((frame for frame in ways[0] if frame in ways[1]), None)
        if common is None:
            unknown = {*ends} - {*self.parents, *self.parents.values()}
            names = ", ".join(f"frame '{frame}' is not known" for frame in sorted(unknown))
            raise TransformError(names or f"no chain of transforms links '{target}' and '{source}'")
        poses = []  # of the ends in the common frame
        for way in ways:
            pose = IDENTITY
            for frame in way[: way.index(common)]:
                pose = multiply(self._links[frame].at(frame, stamp), pose)
            poses.append(pose)
        return to_matrix(multiply(invert(poses[0]), poses[1]))


class _Link:
    """Poses of a frame in its parent, sorted by stamps [ns]."""

    def __init__(self, parent: str, static: bool):
        self.parent, self.static = parent, static
        self.stamps: list[int] = []
        self.poses: list[Pose] = []

    def at(self, frame: str, stamp: int) -> Pose:
        stamps, poses = self.stamps, self.poses
        if self.static:
            return poses[0]
        if not stamps[0] <= stamp <= stamps[-1]:
            span = f"from {stamps[0] / 1e9:.6f} to {stamps[-1] / 1e9:.6f} s"
            raise TransformError(f"'{self.parent}' -> '{frame}' at {stamp / 1e9:.6f} s: recorded {span}")
        after = bisect_left(stamps, stamp)
        if stamps[after] == stamp:
            return poses[after]
        start, end = stamps[after - 1], stamps[after]
        return interpolate(poses[after - 1], poses[after], (stamp - start) / (end - start))


def recorded_transforms(path: Path, asked: Iterable[tuple[str, str]]) -> tuple[RecordedTransforms, str]:
    """Return all transforms of a bag, and the reason why the last invalid one was refused (empty if none was).

    asked: pairs of frames. On the path between them, transforms that are left out are reported on stderr, and time that
    runs backwards raises InputError. Other frames may have odd clocks.
    """
    transforms, unused, refused = RecordedTransforms(), RecordedTransforms(), ""
    tracks: dict[str, _Track] = {}
    for message in bag_messages(path, {TF_TOPIC, TF_STATIC_TOPIC}):
        static = message.topic == TF_STATIC_TOPIC
        for item in content_of(message, path).transforms:
            stamp = stamp_ns(item.header.stamp)
            parent, child = item.header.frame_id.lstrip("/"), item.child_frame_id.lstrip("/")
            track = tracks.setdefault(child, _Track())
            into = unused if not static and track.too_late(stamp) else transforms
            try:
                agrees = into.insert(parent, child, stamp, xyzquat_from_msg(item.transform), static)
            except TransformError as error:
                refused = str(error)
                continue
            if not static:
                track.add(stamp, into is transforms and agrees)
    for target, source in asked:
        between = set(transforms.ancestors(target)) ^ set(transforms.ancestors(source))
        for child in sorted(tracks.keys() & between):
            _report(path, child, tracks[child])
    return transforms, refused


def _report(path: Path, frame: str, track: _Track) -> None:
    """Raise InputError if a frame's time runs backwards; otherwise report how many of its transforms are left out."""
    if track.jump is not None:
        raise InputError(
            f"{path}: the time of frame '{frame}' runs backwards at {track.jump / 1e9:.3f} s; split the bag there"
        )
    if track.left_out:
        print(
            f"{path}: {counted(track.left_out, 'transform')} of '{frame}' left out: more than {_LATEST_NS / 1e9:g} s "
            "late, or another one has the same stamp; do two nodes publish this frame?",
            file=sys.stderr,
        )
