"""A transform buffer that answers as tf2 does, for machines whose ROS comes without tf2.

Every edge of the frame tree keeps a short history. A look-up interpolates each edge at the asked stamp,
linearly in translation and spherically in rotation (the rule of tf2; interpolating on screw motions instead
differs by millimetres on a lever of 0.1 m), then composes the edges. Nothing is extrapolated and nothing is
"latest": a caller who is too early is told so and asks again when more transforms have come.
"""

from __future__ import annotations

import enum
import math
import threading
from bisect import bisect_left

import numpy as np
from scipy.spatial.transform import Rotation

_SECOND = 1_000_000_000
# How far a squared quaternion norm or a rotation's Gram matrix may be from the identity: tf2's own tolerance.
_UNIT_TOLERANCE = 1e-2

Pose = tuple[float, float, float, float, float, float, float]


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
    DUPLICATE = "duplicate"  # the edge already has one at this stamp: the first is kept, as in tf2
    TIME_JUMP = "time jump"  # its edge's time ran backwards (a looped bag): what came before was forgotten


class _Edge:
    """The history of one frame's pose in its parent: parallel lists, sorted by stamp."""

    def __init__(self, parent: str, static: bool) -> None:
        self.parent = parent
        self.static = static
        self.stamps: list[int] = []
        self.poses: list[Pose] = []

    def insert(self, stamp: int, pose: Pose, history: int) -> bool:
        """Keep `pose` in order of time; False if there already is one at this stamp."""
        at = bisect_left(self.stamps, stamp)
        if at < len(self.stamps) and self.stamps[at] == stamp:
            return False
        self.stamps.insert(at, stamp)
        self.poses.insert(at, pose)
        expired = bisect_left(self.stamps, self.stamps[-1] - history)
        del self.stamps[:expired], self.poses[:expired]
        return True

    def at(self, stamp: int) -> Pose:
        """Pose in the parent at a stamp inside the history."""
        if self.static:
            return self.poses[0]
        after = bisect_left(self.stamps, stamp)
        if self.stamps[after] == stamp:
            return self.poses[after]
        start, end = self.stamps[after - 1], self.stamps[after]
        return _interpolate(self.poses[after - 1], self.poses[after], (stamp - start) / (end - start))


class TransformBuffer:
    """History of a tree of frames; safe to fill from one thread and to ask from another.

    Args:
        history_s: seconds of history kept per edge.
        jump_s: a transform older than its edge's newest by more than this is a jump of time, not a late
            message.
    """

    def __init__(self, history_s: float = 10.0, jump_s: float = 1.0) -> None:
        self._history = round(history_s * _SECOND)
        self._jump = round(jump_s * _SECOND)
        self._edges: dict[str, _Edge] = {}
        self._lock = threading.Lock()

    def insert(self, parent: str, child: str, stamp_ns: int, transform: np.ndarray, static: bool = False) -> Insertion:
        """Store T_parent_child, a (4, 4) matrix or [x y z qx qy qz qw], metres.

        A static transform holds at every stamp and replaces the one before it. A child that changes its
        parent, or whose time jumps back, starts a new history. Raises InvalidTransformError on non-finite
        values, on a quaternion whose norm is not 1 (zero included), on empty or equal frame names and on what
        would close a loop.
        """
        parent, child = parent.lstrip("/"), child.lstrip("/")
        if not parent or not child or parent == child:
            raise InvalidTransformError(
                f"transform '{parent}' -> '{child}': needs two different frame names; mend its publisher"
            )
        pose = _checked_pose(transform, f"transform '{parent}' -> '{child}'")
        with self._lock:
            if child in self._ancestors(parent):
                raise InvalidTransformError(
                    f"transform '{parent}' -> '{child}' closes a loop: '{child}' is already above '{parent}'"
                )
            edge = self._edges.get(child)
            if edge is None or edge.parent != parent or edge.static or static:
                edge = self._edges[child] = _Edge(parent, static)
            outcome = Insertion.ADDED
            if edge.stamps and stamp_ns < edge.stamps[-1] - self._jump:
                edge = self._edges[child] = _Edge(parent, static)
                outcome = Insertion.TIME_JUMP
            return outcome if edge.insert(stamp_ns, pose, self._history) else Insertion.DUPLICATE

    def lookup(self, target: str, source: str, stamp_ns: int) -> np.ndarray:
        """T_target_source (4, 4) float64 at `stamp_ns`, through as many edges as it takes.

        Raises UnknownFrameError, DisconnectedError, PastExtrapolationError or FutureExtrapolationError; if
        edges of the chain disagree, the past one, as waiting cannot mend it.
        """
        with self._lock:
            up_from_source, up_from_target = self._paths_to_common_frame(target, source)
            self._require_inside_history(up_from_source + up_from_target, stamp_ns)
            source_pose = self._compose(up_from_source, stamp_ns)
            target_pose = self._compose(up_from_target, stamp_ns)
        return _matrix(_multiply(_invert(target_pose), source_pose))

    def latest_common_stamp(self, target: str, source: str) -> int | None:
        """Newest stamp [ns] at which `lookup` answers; None if only static transforms link the two frames.

        Raises UnknownFrameError or DisconnectedError.
        """
        with self._lock:
            up_from_source, up_from_target = self._paths_to_common_frame(target, source)
            edges = [self._edges[frame] for frame in up_from_source + up_from_target]
            return min((edge.stamps[-1] for edge in edges if not edge.static), default=None)

    def clear(self) -> None:
        """Forget the moving transforms; static ones are sent only once and are kept."""
        with self._lock:
            self._edges = {child: edge for child, edge in self._edges.items() if edge.static}

    def _ancestors(self, frame: str) -> list[str]:
        """The frame, its parent, ... up to its root; finite because `insert` refuses loops."""
        chain = [frame]
        while (edge := self._edges.get(chain[-1])) is not None:
            chain.append(edge.parent)
        return chain

    def _paths_to_common_frame(self, target: str, source: str) -> tuple[list[str], list[str]]:
        """Frames whose edges lead from the source, and from the target, up to their first common frame."""
        target, source = target.lstrip("/"), source.lstrip("/")
        known = self._edges.keys() | {edge.parent for edge in self._edges.values()}
        for frame in (target, source):
            if frame not in known:
                raise UnknownFrameError(f"frame '{frame}' is not known; no transform has named it yet")
        from_target, from_source = self._ancestors(target), self._ancestors(source)
        for depth, frame in enumerate(from_source):
            if frame in from_target:
                return from_source[:depth], from_target[: from_target.index(frame)]
        raise DisconnectedError(
            f"no chain of transforms links '{target}' (root '{from_target[-1]}') "
            f"and '{source}' (root '{from_source[-1]}')"
        )

    def _require_inside_history(self, frames: list[str], stamp: int) -> None:
        early: str | None = None
        for frame in frames:
            edge = self._edges[frame]
            if edge.static:
                continue
            if stamp < edge.stamps[0]:
                raise PastExtrapolationError(
                    f"'{edge.parent}' -> '{frame}' at {stamp / _SECOND:.6f} s: "
                    f"the history starts at {edge.stamps[0] / _SECOND:.6f} s"
                )
            if stamp > edge.stamps[-1]:
                early = early or frame
        if early is not None:
            edge = self._edges[early]
            raise FutureExtrapolationError(
                f"'{edge.parent}' -> '{early}' at {stamp / _SECOND:.6f} s: "
                f"the newest is of {edge.stamps[-1] / _SECOND:.6f} s"
            )

    def _compose(self, frames: list[str], stamp: int) -> Pose:
        """Pose of the first frame in the parent of the last."""
        pose: Pose = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
        for frame in frames:
            pose = _multiply(self._edges[frame].at(stamp), pose)
        return pose


# Scalars, not arrays: on seven numbers NumPy and SciPy cost 10-100 times the arithmetic.


def _checked_pose(transform: np.ndarray, what: str) -> Pose:
    values = np.asarray(transform, float)
    if values.shape == (4, 4):
        return _pose_of_matrix(values, what)
    if values.shape != (7,):
        raise InvalidTransformError(f"{what}: expected a (4, 4) matrix or 7 values, got shape {values.shape}")
    pose = values.tolist()
    if not all(map(math.isfinite, pose)):
        raise InvalidTransformError(f"{what}: holds NaN or infinite values; mend its publisher")
    norm = math.sqrt(sum(v * v for v in pose[3:]))
    if abs(norm * norm - 1.0) > _UNIT_TOLERANCE:
        kind = "zero" if norm < 1e-6 else "not a unit quaternion"
        raise InvalidTransformError(f"{what}: rotation is {kind} (norm {norm:.6g}); normalise it")
    return (*pose[:3], *(v / norm for v in pose[3:]))


def _pose_of_matrix(matrix: np.ndarray, what: str) -> Pose:
    if not np.isfinite(matrix).all():
        raise InvalidTransformError(f"{what}: holds NaN or infinite values; mend its publisher")
    rotation = matrix[:3, :3]
    rigid = np.abs(rotation @ rotation.T - np.eye(3)).max() < _UNIT_TOLERANCE and np.linalg.det(rotation) > 0
    if not rigid or np.abs(matrix[3] - (0, 0, 0, 1)).max() > 1e-9:
        raise InvalidTransformError(f"{what}: the matrix is not rigid; orthonormalise its rotation")
    return (*matrix[:3, 3].tolist(), *Rotation.from_matrix(rotation).as_quat().tolist())


def _rotate(q: tuple[float, ...], x: float, y: float, z: float) -> tuple[float, float, float]:
    qx, qy, qz, qw = q
    cx, cy, cz = 2 * (qy * z - qz * y), 2 * (qz * x - qx * z), 2 * (qx * y - qy * x)
    return (
        x + qw * cx + qy * cz - qz * cy,
        y + qw * cy + qz * cx - qx * cz,
        z + qw * cz + qx * cy - qy * cx,
    )


def _multiply(a: Pose, b: Pose) -> Pose:
    ax, ay, az, aw = a[3:]
    bx, by, bz, bw = b[3:]
    x, y, z = _rotate(a[3:], *b[:3])
    return (
        a[0] + x,
        a[1] + y,
        a[2] + z,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def _invert(pose: Pose) -> Pose:
    conjugate = (-pose[3], -pose[4], -pose[5], pose[6])
    x, y, z = _rotate(conjugate, *pose[:3])
    return (-x, -y, -z, *conjugate)


def _interpolate(start: Pose, end: Pose, fraction: float) -> Pose:
    """Linear in translation, spherical linear in rotation along the shorter arc."""
    a, b = start[3:], end[3:]
    if sum(u * v for u, v in zip(a, b, strict=True)) < 0:
        b = tuple(-v for v in b)
    # half-angle form: accurate for tiny angles, where acos of the scalar product is not
    apart = math.sqrt(sum((u - v) ** 2 for u, v in zip(a, b, strict=True)))
    together = math.sqrt(sum((u + v) ** 2 for u, v in zip(a, b, strict=True)))
    angle = 2 * math.atan2(apart, together)
    if angle < 1e-9:
        weight_a, weight_b = 1 - fraction, fraction
    else:
        weight_a = math.sin((1 - fraction) * angle) / math.sin(angle)
        weight_b = math.sin(fraction * angle) / math.sin(angle)
    position = (u + fraction * (v - u) for u, v in zip(start[:3], end[:3], strict=True))
    return (*position, *(weight_a * u + weight_b * v for u, v in zip(a, b, strict=True)))


def _matrix(pose: Pose) -> np.ndarray:
    x, y, z, qx, qy, qz, qw = pose
    scale = 2.0 / (qx * qx + qy * qy + qz * qz + qw * qw)
    return np.array(
        [
            [1 - scale * (qy * qy + qz * qz), scale * (qx * qy - qz * qw), scale * (qx * qz + qy * qw), x],
            [scale * (qx * qy + qz * qw), 1 - scale * (qx * qx + qz * qz), scale * (qy * qz - qx * qw), y],
            [scale * (qx * qz - qy * qw), scale * (qy * qz + qx * qw), 1 - scale * (qx * qx + qy * qy), z],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )
