"""Transforms from `/tf` and `/tf_static`, kept by tf2."""

from __future__ import annotations

import threading
from collections.abc import Callable, Collection
from functools import partial
from types import SimpleNamespace

import numpy as np
from geometry_msgs.msg import TransformStamped
from rclpy.node import Node
from rclpy.time import Time
from tf2_ros import Buffer, TransformException, TransformListener

from ..message_arrays import SECOND, stamp_ns, xyzquat_from_msg
from ..transforms.queue import Wait
from ..transforms.rigid import TransformError, to_matrix
from ..transforms.tree import TransformWatch
from . import qos

_JUMPED = "time ran back a moment ago"


class TransformSource:
    """Transforms from TF; the node's executor or, on the ROS wheels, another thread reads them.

    `frames` are those whose poses relative to each other are looked up. If a transform on the way between them jumps
    back in time, so has the recording, and all moving transforms are forgotten. Other frames may have clocks of their
    own.

    In the node's executor, `on_jump` is called with the stamp [ns] after a jump, `on_bad` with a reason for each
    transform that was refused, and `on_update` when a transform that a `lookup` has to wait for has come. After a jump
    no look-up is answered before `on_jump` was called: the caller would take it for one from before the jump.
    """

    def __init__(
        self,
        node: Node,
        frames: Collection[str],
        on_update: Callable[[], object] = lambda: None,
        on_jump: Callable[[int], object] = lambda stamp: None,
        on_bad: Callable[[str], object] = lambda reason: None,
    ):
        self._on_update, self._on_jump, self._on_bad = on_update, on_jump, on_bad
        self._watch = TransformWatch([_name(frame) for frame in frames])
        self._lock = threading.RLock()
        self._awaited: dict[tuple[str, str], int] = {}
        self._jumps: list[int] = []
        self._bad: list[str] = []
        self._node, self._closed = node, False
        self._wake = node.create_guard_condition(self._on_wake)
        self._buffer = Buffer()
        checked = SimpleNamespace(
            set_transform=partial(self._take, False), set_transform_static=partial(self._take, True)
        )
        self._listener = TransformListener(checked, node, qos=qos.TF_SUBSCRIBER, static_qos=qos.TF_STATIC_SUBSCRIBER)

    def close(self) -> None:
        """Stop listening; nothing is called after this."""
        self._listener.unregister()
        self._closed = True
        self._node.destroy_guard_condition(self._wake)

    def lookup(self, target: str, source: str, stamp: int) -> np.ndarray | Wait:
        """Return T_target_source (4, 4) at `stamp` [ns], or `Wait` while it may still come.

        Raises TransformError if the stamp lies before everything that is known.
        """
        names = _name(target), _name(source)
        with self._lock:
            if self._jumps:
                return Wait(_JUMPED)
            try:
                if stamp <= 0:  # to tf2, 0 means the newest
                    raise TransformException(f"stamp {stamp / SECOND:g} s is not after the epoch")
                return self._look_up(names, stamp)
            except TransformException as error:
                if self._has(names, stamp):
                    raise TransformError(f"the history starts after it: {error}") from error
                self._awaited[names] = min(stamp, self._awaited.get(names, stamp))
                return Wait(str(error))

    def known(self, target: str, source: str, stamp: int) -> np.ndarray | None:
        """Return the transform of `lookup`; None while it may still come, and for a stamp before all that is known."""
        try:
            pose = self.lookup(target, source, stamp)
        except TransformError:
            return None
        return None if isinstance(pose, Wait) else pose

    def latest_stamp(self, target: str, source: str) -> int | None:
        """Return the newest stamp [ns] at which `lookup` answers; None if only static transforms link the two frames.

        Raises TransformError if nothing links them yet.
        """
        with self._lock:
            if self._jumps:
                raise TransformError(_JUMPED)
            try:
                return self._latest((_name(target), _name(source))) or None
            except TransformException as error:
                raise TransformError(str(error)) from error

    def newest(self, target: str, source: str) -> np.ndarray:
        """Return T_target_source (4, 4) between any two frames at the newest stamp that tf2 has of all links.

        Raises TransformError if they are not linked.
        """
        try:
            return self._look_up((_name(target), _name(source)), 0)
        except TransformException as error:
            raise TransformError(str(error)) from error

    def rewind(self, stamp: int) -> None:
        """Follow the images' time back to `stamp` [ns]: forget transforms that come from before the jump."""
        with self._lock:
            if self._watch.is_ahead(stamp):
                self.forget()

    def forget(self) -> None:
        """Forget all moving transforms, as after a jump of time that is too short to show in their stamps."""
        with self._lock:
            self._buffer.clear()
            self._watch.forget()

    def _look_up(self, names: tuple[str, str], stamp: int) -> np.ndarray:
        found = self._buffer.lookup_transform(*names, Time(nanoseconds=stamp))
        return to_matrix(xyzquat_from_msg(found.transform))

    def _latest(self, names: tuple[str, str]) -> int:
        return self._buffer.get_latest_common_time(*names).nanoseconds

    def _has(self, names: tuple[str, str], stamp: int) -> bool:
        """Return whether the frames are linked and no transform of `stamp` [ns] is still to come."""
        try:
            return not 0 < self._latest(names) < stamp
        except TransformException:
            return False

    def _on_wake(self) -> None:
        if self._closed:  # it was closed in the same round of the executor
            return
        with self._lock:
            jumps, self._jumps = self._jumps, []
            bad, self._bad = self._bad, []
        for reason in bad:
            self._on_bad(reason)
        for stamp in jumps:
            self._on_jump(stamp)
        self._on_update()

    # --- where the listener reads

    def _take(self, static: bool, transform: TransformStamped, authority: str) -> None:
        """Hand a transform on to tf2, unless it is invalid."""
        parent, child = _name(transform.header.frame_id), _name(transform.child_frame_id)
        stamp = stamp_ns(transform.header.stamp)
        with self._lock:
            try:
                self._watch.link(parent, child, xyzquat_from_msg(transform.transform))
            except TransformError as error:
                self._bad.append(f"{'/tf_static' if static else '/tf'}: {error}")
            else:
                if static:
                    self._buffer.set_transform_static(transform, authority)
                else:
                    if self._watch.has_jumped(child, stamp):
                        self._jumps.append(stamp)
                        self._buffer.clear()
                    self._buffer.set_transform(transform, authority)
            if self._bad or self._jumps or (self._awaited and self._has_come()):
                self._wake.trigger()

    def _has_come(self) -> bool:
        """Return, once for each, whether a transform that a `lookup` has to wait for is there."""
        come = [names for names, stamp in self._awaited.items() if self._has(names, stamp)]
        for names in come:
            del self._awaited[names]
        return bool(come)


def _name(frame: str) -> str:
    """Return a frame's name without the leading slash of ROS 1."""
    return frame.lstrip("/")
