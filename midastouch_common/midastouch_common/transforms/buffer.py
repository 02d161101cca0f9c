"""Trees of frames whose poses are known over time.

Every link of the tree keeps a short history. Nothing is extrapolated, and there is no "latest": a look-up that
comes too early fails, and may be repeated when more transforms have come. A look-up interpolates each link at the
requested stamp, linearly in translation and spherically in rotation (the rule of tf2; interpolation on screw motions
differs by millimetres on a lever of 0.1 m), then composes the links. It answers as tf2 does, without using tf2.
"""

from __future__ import annotations

import enum
import threading
from bisect import bisect_left
from collections.abc import Callable, Collection, Sequence

import numpy as np

from ..message_arrays import SECOND
from .rigid import (
    IDENTITY,
    DisconnectedError,
    FutureExtrapolationError,
    InvalidTransformError,
    PastExtrapolationError,
    Pose,
    UnknownFrameError,
    checked_pose,
    interpolate,
    invert,
    multiply,
    to_matrix,
)

HISTORY_S = 10.0
JUMP_S = 1.0


class Insertion(enum.Enum):
    """Outcome of inserting a transform."""

    ADDED = "added"
    DUPLICATE = "duplicate"  # the link already has one at this stamp, which is kept
    TIME_JUMP = "time jump"  # its link's time ran backwards (a looped bag): the link's history was forgotten


def ancestors(frame: str, parent_of: Callable[[str], str | None]) -> list[str]:
    """Return the frame, its parent, ... up to its root, which has no parent; in a loop each frame comes once."""
    chain = {frame: None}
    while (frame := parent_of(frame)) is not None and frame not in chain:
        chain[frame] = None
    return list(chain)


class _Link:
    """One frame's pose in its parent, at the stamps [ns] from `oldest` to `newest` or, if static, at any time.

    Args: history [ns], largest age of a kept pose, relative to the newest one.
    """

    def __init__(self, parent: str, static: bool, history: int) -> None:
        self.parent, self.static, self._history = parent, static, history
        self._stamps: list[int] = []
        self._poses: list[Pose] = []

    @property
    def oldest(self) -> int:
        return self._stamps[0]

    @property
    def newest(self) -> int:
        return self._stamps[-1]

    def add(self, stamp: int, pose: Pose) -> bool:
        """Keep `pose` in order of time; return False if there already is one at this stamp."""
        at = bisect_left(self._stamps, stamp)
        if at < len(self._stamps) and self._stamps[at] == stamp:
            return False
        self._poses.insert(at, pose)
        self._stamps.insert(at, stamp)
        expired = bisect_left(self._stamps, self.newest - self._history)
        del self._stamps[:expired], self._poses[:expired]
        return True

    def at(self, stamp: int) -> Pose:
        """Return the pose in the parent at a stamp inside the history."""
        if self.static:
            return self._poses[0]
        after = bisect_left(self._stamps, stamp)
        if self._stamps[after] == stamp:
            return self._poses[after]
        start, end = self._stamps[after - 1], self._stamps[after]
        return interpolate(self._poses[after - 1], self._poses[after], (stamp - start) / (end - start))


class TransformBuffer:
    """Tree of frames, with a history of each link; safe to use from several threads.

    Args:
        history_s: seconds of history kept per link.
        jump_s: a transform older than its link's newest by more than this is a jump of time, not a late
            message.
    """

    def __init__(self, history_s: float = HISTORY_S, jump_s: float = JUMP_S) -> None:
        self._history, self._jump = round(history_s * SECOND), round(jump_s * SECOND)
        self._links: dict[str, _Link] = {}
        self._lock = threading.RLock()

    def insert(
        self,
        parent: str,
        child: str,
        stamp_ns: int,
        transform: np.ndarray | Sequence[float],
        static: bool = False,
    ) -> Insertion:
        """Store T_parent_child, a (4, 4) matrix or [x y z qx qy qz qw], metres.

        A static transform holds at every stamp and replaces the one before it. A child that changes its
        parent, or whose time jumps back, starts a new history. Raises InvalidTransformError on non-finite
        values, on a quaternion whose norm is not 1 (zero included), on empty or equal frame names and on a
        transform that would close a loop.
        """
        parent, child = parent.lstrip("/"), child.lstrip("/")
        try:
            if not parent or not child or parent == child:
                raise InvalidTransformError("needs two different frame names; fix its publisher")
            pose = checked_pose(transform)
            with self._lock:
                return self._insert(parent, child, stamp_ns, pose, static)
        except InvalidTransformError as error:
            raise InvalidTransformError(f"transform '{parent}' -> '{child}': {error}") from None

    def _insert(self, parent: str, child: str, stamp: int, pose: Pose, static: bool) -> Insertion:
        link = self._links.get(child)
        if link is None or link.parent != parent:
            if child in self.ancestors(parent):
                raise InvalidTransformError(f"closes a loop: '{child}' is already above '{parent}'")
            link = None
        outcome = Insertion.ADDED
        if link is not None and not static and not link.static and stamp < link.newest - self._jump:
            link, outcome = None, Insertion.TIME_JUMP
        if link is None or static or link.static:
            link = self._links[child] = _Link(parent, static, self._history)
        return outcome if link.add(stamp, pose) else Insertion.DUPLICATE

    def lookup(self, target: str, source: str, stamp_ns: int) -> np.ndarray:
        """Return T_target_source (4, 4) float64 at `stamp_ns`, through as many links as it takes.

        Raises UnknownFrameError, DisconnectedError, PastExtrapolationError or FutureExtrapolationError. If
        links of the chain lie on both sides of their histories, it is the past one, as waiting cannot fix that.
        """
        names = target.lstrip("/"), source.lstrip("/")
        if names[0] == names[1]:
            return np.eye(4)
        with self._lock:
            up_from_target, up_from_source = self._paths_to_common_frame(*names)
            self._require_inside_history(up_from_source + up_from_target, stamp_ns)
            target_in_root, source_in_root = (self._compose(way, stamp_ns) for way in (up_from_target, up_from_source))
            return to_matrix(multiply(invert(target_in_root), source_in_root))

    def _compose(self, frames: list[str], stamp: int) -> Pose:
        """Return the pose of the first frame in the parent of the last."""
        pose = IDENTITY
        for frame in frames:
            pose = multiply(self._links[frame].at(stamp), pose)
        return pose

    def latest_common_stamp(self, target: str, source: str) -> int | None:
        """Return the newest stamp [ns] at which `lookup` answers; None if only static transforms link the two frames.

        Raises UnknownFrameError or DisconnectedError.
        """
        with self._lock:
            paths = self._paths_to_common_frame(target.lstrip("/"), source.lstrip("/"))
            links = [self._links[frame] for path in paths for frame in path]
            return min((link.newest for link in links if not link.static), default=None)

    def clear(self) -> None:
        """Forget the moving transforms; static ones are sent only once and are kept."""
        self.keep(())

    def keep(self, frames: Collection[str]) -> None:
        """Forget the moving transforms of all frames to their parents, except of these frames."""
        with self._lock:
            self._links = {child: link for child, link in self._links.items() if link.static or child in frames}

    def newest(self, frame: str) -> int | None:
        """Return the stamp [ns] of a moving frame's newest transform to its parent; None without one."""
        with self._lock:
            link = self._links.get(frame)
            return None if link is None or link.static else link.newest

    def ancestors(self, frame: str) -> list[str]:
        """Return the frame, its parent, ... up to its root."""
        with self._lock:
            return ancestors(frame, lambda child: link.parent if (link := self._links.get(child)) else None)

    def _paths_to_common_frame(self, target: str, source: str) -> tuple[list[str], list[str]]:
        """Return the frames whose links lead from the target, and from the source, up to their first common frame."""
        for frame in (target, source):
            if frame not in self._links and all(link.parent != frame for link in self._links.values()):
                raise UnknownFrameError(f"frame '{frame}' is not known; no transform has named it yet")
        from_target, from_source = self.ancestors(target), self.ancestors(source)
        for depth, frame in enumerate(from_source):
            if frame in from_target:
                return from_target[: from_target.index(frame)], from_source[:depth]
        raise DisconnectedError(
            f"no chain of transforms links '{target}' (root '{from_target[-1]}') "
            f"and '{source}' (root '{from_source[-1]}')"
        )

    def _require_inside_history(self, frames: list[str], stamp: int) -> None:
        early: str | None = None
        for frame in frames:
            link = self._links[frame]
            if link.static:
                continue
            if stamp < link.oldest:
                raise PastExtrapolationError(
                    f"'{link.parent}' -> '{frame}' at {stamp / SECOND:.6f} s: "
                    f"the history starts at {link.oldest / SECOND:.6f} s"
                )
            if stamp > link.newest:
                early = early or frame
        if early is not None:
            link = self._links[early]
            raise FutureExtrapolationError(
                f"'{link.parent}' -> '{early}' at {stamp / SECOND:.6f} s: the newest is of {link.newest / SECOND:.6f} s"
            )
