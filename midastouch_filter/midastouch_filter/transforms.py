"""Trees of frames whose poses are known over time, and the buffer for machines whose ROS comes without tf2.

Every link of the tree keeps a short history. A look-up interpolates each link at the asked stamp, linearly in
translation and spherically in rotation (the rule of tf2; interpolating on screw motions instead differs by millimetres
on a lever of 0.1 m), then composes the links. Nothing is extrapolated and nothing is "latest": a caller who is too
early is told so and asks again when more transforms have come.
"""

from __future__ import annotations

import abc
import enum
import math
import threading
from bisect import bisect_left
from collections.abc import Callable, Collection, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from .scalar_pose import IDENTITY, Pose, interpolate, invert, multiply, to_matrix

SECOND = 1_000_000_000
HISTORY_S = 10.0
JUMP_S = 1.0
# How far a squared quaternion norm or a rotation's Gram matrix may be from the identity: tf2's own tolerance.
_UNIT_TOLERANCE = 1e-2


class TransformError(Exception):
    """A transform cannot be stored or looked up; the message names the frames and the reason."""


class InvalidTransformError(TransformError):
    """The transform offered is not a rigid transform between two frames of a tree."""


class UnknownFrameError(TransformError):
    """A frame was never mentioned; it may still come."""


class DisconnectedError(TransformError):
    """Both frames are known, but no chain of transforms links them (yet)."""


class PastExtrapolationError(TransformError):
    """The stamp is older than the history kept; waiting does not help."""


class FutureExtrapolationError(TransformError):
    """The stamp is newer than the newest transform; wait for the next one."""


class Insertion(enum.Enum):
    """What became of an inserted transform."""

    ADDED = "added"
    DUPLICATE = "duplicate"  # the link already has one at this stamp: the first is kept
    TIME_JUMP = "time jump"  # its link's time ran backwards (a looped bag): what came before was forgotten


def ancestors(frame: str, parent_of: Callable[[str], str | None]) -> list[str]:
    """The frame, its parent, ... up to its root, which has none, or to where a loop closes."""
    chain = [frame]
    while (parent := parent_of(chain[-1])) is not None and parent not in chain:
        chain.append(parent)
    return chain


class Link(abc.ABC):
    """One frame's pose in its parent: at the stamps [ns] from `oldest` to `newest`, or, if static, always.

    Args: history, how long before the newest a pose is kept [ns].
    """

    def __init__(self, parent: str, static: bool, history: int) -> None:
        self.parent, self.static, self._history = parent, static, history
        self._stamps: list[int] = []

    @property
    def oldest(self) -> int:
        return self._stamps[0]

    @property
    def newest(self) -> int:
        return self._stamps[-1]

    def add(self, stamp: int, pose: Pose) -> bool:
        """Keep `pose` in order of time; False if there already is one at this stamp."""
        at = bisect_left(self._stamps, stamp)
        if at < len(self._stamps) and self._stamps[at] == stamp:
            return False
        self._store(at, stamp, pose)
        self._stamps.insert(at, stamp)
        expired = bisect_left(self._stamps, self.newest - self._history)
        if expired:
            del self._stamps[:expired]
            self._drop(expired)
        return True

    @abc.abstractmethod
    def _store(self, at: int, stamp: int, pose: Pose) -> None:
        """Keep `pose` as the one numbered `at` in order of time."""

    @abc.abstractmethod
    def _drop(self, count: int) -> None:
        """Forget so many of the oldest poses."""


class FrameTree(abc.ABC):
    """Links and the rules that hold for them, wherever their poses are kept; safe to use from several threads.

    Args:
        history_s: seconds of history kept per link.
        jump_s: a transform older than its link's newest by more than this is a jump of time, not a late
            message.
    """

    def __init__(self, history_s: float = HISTORY_S, jump_s: float = JUMP_S) -> None:
        self._history, self._jump = round(history_s * SECOND), round(jump_s * SECOND)
        self._links: dict[str, Link] = {}
        self._lock = threading.RLock()

    @abc.abstractmethod
    def _make_link(self, parent: str, child: str, static: bool) -> Link:
        """A link without a history, whatever was known of `child` before."""

    @abc.abstractmethod
    def _pose(self, target: list[str], source: list[str], stamp: int, names: tuple[str, str]) -> np.ndarray:
        """T_target_source (4, 4); target, source: the frames whose links lead from each up to their common frame."""

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
        values, on a quaternion whose norm is not 1 (zero included), on empty or equal frame names and on what
        would close a loop.
        """
        parent, child = parent.lstrip("/"), child.lstrip("/")
        try:
            if not parent or not child or parent == child:
                raise InvalidTransformError("needs two different frame names; mend its publisher")
            pose = _checked_pose(transform)
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
            link = self._links[child] = self._make_link(parent, child, static)
        return outcome if link.add(stamp, pose) else Insertion.DUPLICATE

    def lookup(self, target: str, source: str, stamp_ns: int) -> np.ndarray:
        """T_target_source (4, 4) float64 at `stamp_ns`, through as many links as it takes.

        Raises UnknownFrameError, DisconnectedError, PastExtrapolationError or FutureExtrapolationError; if
        links of the chain disagree, the past one, as waiting cannot mend it.
        """
        names = target.lstrip("/"), source.lstrip("/")
        if names[0] == names[1]:
            return np.eye(4)
        with self._lock:
            up_from_target, up_from_source = self._paths_to_common_frame(*names)
            self._require_inside_history(up_from_source + up_from_target, stamp_ns)
            return self._pose(up_from_target, up_from_source, stamp_ns, names)

    def latest_common_stamp(self, target: str, source: str) -> int | None:
        """Newest stamp [ns] at which `lookup` answers; None if only static transforms link the two frames.

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
        """Forget the moving transforms of all but these frames to their parents."""
        with self._lock:
            self._links = {child: link for child, link in self._links.items() if link.static or child in frames}

    def newest(self, frame: str) -> int | None:
        """Stamp [ns] of the newest transform of a moving frame to its parent; None if nothing is known of one."""
        with self._lock:
            link = self._links.get(frame)
            return None if link is None or link.static else link.newest

    def ancestors(self, frame: str) -> list[str]:
        """The frame, its parent, ... up to its root."""
        with self._lock:
            return ancestors(frame, lambda child: link.parent if (link := self._links.get(child)) else None)

    def _paths_to_common_frame(self, target: str, source: str) -> tuple[list[str], list[str]]:
        """Frames whose links lead from the target, and from the source, up to their first common frame."""
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


def _checked_pose(transform: np.ndarray | Sequence[float]) -> Pose:
    if isinstance(transform, np.ndarray):
        if transform.shape == (4, 4):
            return _pose_of_matrix(transform)
        transform = transform.tolist()
    if len(transform) != 7:
        raise InvalidTransformError(f"expected a (4, 4) matrix or 7 values, got shape {np.shape(transform)}")
    if not all(map(math.isfinite, transform)):
        raise InvalidTransformError("holds NaN or infinite values; mend its publisher")
    x, y, z, qx, qy, qz, qw = transform
    square = qx * qx + qy * qy + qz * qz + qw * qw
    norm = math.sqrt(square)
    if abs(square - 1.0) > _UNIT_TOLERANCE:
        kind = "zero" if norm < 1e-6 else "not a unit quaternion"
        raise InvalidTransformError(f"rotation is {kind} (norm {norm:.6g}); normalise it")
    return x, y, z, qx / norm, qy / norm, qz / norm, qw / norm


def _pose_of_matrix(matrix: np.ndarray) -> Pose:
    if not np.isfinite(matrix).all():
        raise InvalidTransformError("holds NaN or infinite values; mend its publisher")
    rotation = matrix[:3, :3]
    rigid = np.abs(rotation @ rotation.T - np.eye(3)).max() < _UNIT_TOLERANCE and np.linalg.det(rotation) > 0
    if not rigid or np.abs(matrix[3] - (0, 0, 0, 1)).max() > 1e-9:
        raise InvalidTransformError("the matrix is not rigid; orthonormalise its rotation")
    return (*matrix[:3, 3].tolist(), *Rotation.from_matrix(rotation).as_quat().tolist())
