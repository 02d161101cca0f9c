"""Transforms at a stamp from `/tf` and `/tf_static`: by tf2 where it is installed, else by our own buffer."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass

import numpy as np
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.time import Time
from tf2_msgs.msg import TFMessage

from midastouch_perception.errors import InputError
from midastouch_perception.ros import qos
from midastouch_perception.ros.conversions import stamp_ns, transform_from_msg

from ..transforms import (
    DisconnectedError,
    FutureExtrapolationError,
    Insertion,
    InvalidTransformError,
    PastExtrapolationError,
    TransformBuffer,
    TransformError,
    UnknownFrameError,
)

try:
    import tf2_ros
except ImportError:  # the PyPI wheels have no tf2
    tf2_ros = None

_SECOND = 1_000_000_000
_HISTORY_S = 10
# A transform older than the newest by more than this is time running backwards, as in TransformBuffer.
_JUMP_NS = _SECOND


@dataclass(frozen=True)
class Wait:
    """The transform is not there yet but may still come; `reason` says what is missing."""

    reason: str


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
        if stamp < self._newest.get(child, stamp) - _JUMP_NS:
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


class TransformSource:
    """Listens to TF and answers `lookup`.

    `frames` are those whose places relative to each other are asked for: when a transform between them jumps back in
    time, so has the recording, and all moving transforms are forgotten. Other frames may have clocks of their own.

    `on_update` is called after every TF message, so that whoever waits can ask again; `on_jump` before it,
    once per jump between `frames`; `on_bad` with a reason for each transform that was refused.
    """

    def __init__(
        self,
        node: Node,
        frames: Collection[str],
        on_update: Callable[[], None],
        on_jump: Callable[[], None],
        on_bad: Callable[[str], None],
    ):
        self._buffer = Tf2Buffer() if tf2_ros is not None else OwnBuffer()
        self._on_update, self._on_jump, self._on_bad = on_update, on_jump, on_bad
        self._frames = [frame.lstrip("/") for frame in frames]
        self._parents: dict[str, str] = {}
        self._newest: dict[str, int] = {}  # stamp of the last transform of each moving frame
        node.create_subscription(TFMessage, "/tf", self._on_tf, qos.TF)
        node.create_subscription(TFMessage, "/tf_static", self._on_tf_static, qos.TF_STATIC_SUBSCRIBER)

    def lookup(self, target: str, source: str, stamp: int | None) -> np.ndarray | Wait:
        """T_target_source (4, 4) at `stamp` [ns] (None: the newest), or `Wait` while it may still come.

        Raises PastExtrapolationError when the stamp lies before everything that is known.
        """
        try:
            return self._buffer.lookup(target, source, stamp)
        except PastExtrapolationError:
            raise
        except TransformError as error:
            return Wait(str(error))

    def rewind(self, stamp: int) -> None:
        """The images' time ran back to `stamp` [ns]: forget transforms that come from before the jump."""
        if any(self._newest.get(frame, stamp) > stamp + _JUMP_NS for frame in self._between()):
            self._forget()

    def _on_tf(self, msg: TFMessage) -> None:
        jumped = False
        for transform in msg.transforms:
            try:
                jumped |= self._insert(transform)
            except (InvalidTransformError, InputError) as error:
                self._on_bad(f"/tf: {error}")
        if jumped:
            self._on_jump()
        self._on_update()

    def _on_tf_static(self, msg: TFMessage) -> None:
        for transform in msg.transforms:
            try:
                self._buffer.insert_static(transform)
            except (InvalidTransformError, InputError) as error:
                self._on_bad(f"/tf_static: {error}")
            else:
                self._name(transform)
        self._on_update()

    def _insert(self, transform) -> bool:
        """Store a moving transform; whether time jumped back between `frames`."""
        outcome = self._buffer.insert(transform)
        jumped = outcome is Insertion.TIME_JUMP and self._name(transform) in self._between()
        if jumped:
            self._forget()
            self._buffer.insert(transform)
        self._newest[self._name(transform)] = stamp_ns(transform.header.stamp)
        return jumped

    def _forget(self) -> None:
        self._buffer.clear()
        self._newest.clear()

    def _name(self, transform) -> str:
        """Its frame, which is from now on known to hang below its parent."""
        child = transform.child_frame_id.lstrip("/")
        self._parents[child] = transform.header.frame_id.lstrip("/")
        return child

    def _between(self) -> set[str]:
        """The frames whose transforms to their parents link `frames`; while these are not linked, all above them."""
        chains = [self._chain(frame) for frame in self._frames]
        return set.union(*chains) - set.intersection(*chains)

    def _chain(self, frame: str) -> set[str]:
        chain = {frame}
        while (frame := self._parents.get(frame, frame)) not in chain:
            chain.add(frame)
        return chain
