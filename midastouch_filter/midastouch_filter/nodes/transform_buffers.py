"""What transforms are kept in: tf2's buffer where it is installed, else our own, behind one interface."""

from __future__ import annotations

import numpy as np
from rclpy.duration import Duration
from rclpy.time import Time

from midastouch_perception.ros.conversions import stamp_ns, transform_from_msg

from ..transforms import (
    DisconnectedError,
    FutureExtrapolationError,
    Insertion,
    InvalidTransformError,
    PastExtrapolationError,
    TransformBuffer,
    UnknownFrameError,
)

try:
    import tf2_ros
except ImportError:  # the PyPI wheels have no tf2
    tf2_ros = None

_SECOND = 1_000_000_000
_HISTORY_S = 10
JUMP_NS = _SECOND
"""A transform older than the newest by more than this is time running backwards, as in TransformBuffer."""


def make_buffer() -> Tf2Buffer | OwnBuffer:
    """tf2's if it is there."""
    return Tf2Buffer() if tf2_ros is not None else OwnBuffer()


class Tf2Buffer:
    """tf2's buffer behind the interface of `TransformBuffer`.

    In fact two, as tf2 cannot forget a single frame, only all of them: one for the newest transforms, which starts
    anew with any frame whose time jumps back, and one with the history, which does so when its user says `clear`.
    """

    def __init__(self, history_s: float = _HISTORY_S):
        self._history, self._newest = _Tf2History(history_s), _Tf2History(history_s)

    def insert(self, transform) -> Insertion:
        """Store a moving TransformStamped; raises InputError.

        One whose time jumped back enters the history only when it is inserted again after `clear`.
        """
        if self._newest.insert(transform) is Insertion.TIME_JUMP:
            self._newest.clear()
            self._newest.insert(transform)
        return self._history.insert(transform)

    def insert_static(self, transform) -> None:
        """Store a static TransformStamped."""
        self._newest.insert_static(transform)
        self._history.insert_static(transform)

    def lookup(self, target: str, source: str, stamp: int | None) -> np.ndarray:
        """T_target_source (4, 4) at a stamp [ns], or the newest one for None; errors as `TransformBuffer`.

        Raises InvalidTransformError for an empty frame.
        """
        history = self._newest if stamp is None else self._history
        return history.lookup(target.lstrip("/"), source.lstrip("/"), stamp)

    def clear(self) -> None:
        """Forget the moving transforms (tf2 keeps the static ones)."""
        self._newest.clear()
        self._history.clear()


class _Tf2History:
    """One buffer of tf2, and the newest stamp of each frame in it."""

    def __init__(self, history_s: float = _HISTORY_S):
        self._tf2 = tf2_ros
        self._buffer = tf2_ros.Buffer(cache_time=Duration(seconds=history_s))
        self._newest: dict[str, int] = {}

    def insert(self, transform) -> Insertion:
        """Store a moving TransformStamped, but for one whose time jumped back; raises InputError."""
        transform_from_msg(transform.transform)  # tf2 itself only logs what is not finite
        stamp, child = stamp_ns(transform.header.stamp), transform.child_frame_id
        if stamp < self._newest.get(child, stamp) - JUMP_NS:
            return Insertion.TIME_JUMP
        self._newest[child] = max(stamp, self._newest.get(child, stamp))
        self._buffer.set_transform(transform, "midastouch")
        return Insertion.ADDED

    def insert_static(self, transform) -> None:
        self._buffer.set_transform_static(transform, "midastouch")

    def lookup(self, target: str, source: str, stamp: int | None) -> np.ndarray:
        if stamp is not None and stamp <= 0:
            raise PastExtrapolationError(f"stamp {stamp / _SECOND:g} s: not after the epoch; 0 means the newest to tf2")
        time = Time(nanoseconds=stamp or 0)
        try:
            return transform_from_msg(self._buffer.lookup_transform_core(target, source, time).transform)
        except self._tf2.LookupException as error:
            raise UnknownFrameError(str(error)) from error
        except self._tf2.InvalidArgumentException as error:
            raise InvalidTransformError(str(error)) from error
        except self._tf2.ConnectivityException as error:
            raise DisconnectedError(str(error)) from error
        except self._tf2.ExtrapolationException as error:
            # tf2 has one exception for both directions
            newest = self._buffer.get_latest_common_time(target, source).nanoseconds
            future = stamp is not None and stamp > newest
            kind = FutureExtrapolationError if future else PastExtrapolationError
            raise kind(str(error)) from error

    def clear(self) -> None:
        self._buffer.clear()
        self._newest.clear()


class OwnBuffer:
    """`TransformBuffer` fed with TransformStamped messages."""

    def __init__(self, history_s: float = _HISTORY_S):
        self._buffer = TransformBuffer(history_s)
        self.clear = self._buffer.clear

    def insert(self, transform) -> Insertion:
        """Store a moving TransformStamped; raises InvalidTransformError."""
        return self._insert(transform, static=False)

    def insert_static(self, transform) -> None:
        """Store a static TransformStamped; raises InvalidTransformError."""
        self._insert(transform, static=True)

    def _insert(self, msg, static: bool) -> Insertion:
        return self._buffer.insert(
            msg.header.frame_id,
            msg.child_frame_id,
            stamp_ns(msg.header.stamp),
            _values(msg.transform),
            static,
        )

    def lookup(self, target: str, source: str, stamp: int | None) -> np.ndarray:
        """T_target_source (4, 4) at a stamp [ns], or the newest one for None; errors as `TransformBuffer`."""
        if stamp is None:
            stamp = self._buffer.latest_common_stamp(target, source) or 0
        return self._buffer.lookup(target, source, stamp)


def _values(transform) -> np.ndarray:
    p, q = transform.translation, transform.rotation
    return np.array([p.x, p.y, p.z, q.x, q.y, q.z, q.w])
