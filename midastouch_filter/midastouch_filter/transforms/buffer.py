"""The buffer for machines whose ROS comes without tf2.

A look-up interpolates each link at the asked stamp, linearly in translation and spherically in rotation (the rule of
tf2; interpolating on screw motions instead differs by millimetres on a lever of 0.1 m), then composes the links.
"""

from __future__ import annotations

from bisect import bisect_left

import numpy as np

from .frame_tree import FrameTree, Link
from .scalar_pose import IDENTITY, Pose, interpolate, invert, multiply, to_matrix


class TransformBuffer(FrameTree):
    """A tree that keeps its links' poses itself."""

    def _make_link(self, parent: str, child: str, static: bool) -> Link:
        return _History(parent, static, self._history)

    def _pose(self, target: list[str], source: list[str], stamp: int, names: tuple[str, str]) -> np.ndarray:
        return to_matrix(multiply(invert(self._compose(target, stamp)), self._compose(source, stamp)))

    def _compose(self, frames: list[str], stamp: int) -> Pose:
        """Pose of the first frame in the parent of the last."""
        pose = IDENTITY
        for frame in frames:
            pose = multiply(self._links[frame].at(stamp), pose)
        return pose


class _History(Link):
    """Poses beside their stamps."""

    def __init__(self, parent: str, static: bool, history: int) -> None:
        super().__init__(parent, static, history)
        self._poses: list[Pose] = []

    def _store(self, at: int, stamp: int, pose: Pose) -> None:
        self._poses.insert(at, pose)

    def _drop(self, count: int) -> None:
        del self._poses[:count]

    def at(self, stamp: int) -> Pose:
        """Pose in the parent at a stamp inside the history."""
        if self.static:
            return self._poses[0]
        after = bisect_left(self._stamps, stamp)
        if self._stamps[after] == stamp:
            return self._poses[after]
        start, end = self._stamps[after - 1], self._stamps[after]
        return interpolate(self._poses[after - 1], self._poses[after], (stamp - start) / (end - start))
