"""Transforms from `/tf` and `/tf_static`."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Collection
from typing import NamedTuple

import numpy as np
from rclpy.node import Node
from tf2_msgs.msg import TFMessage

from ..errors import InputError
from ..message_arrays import SECOND
from ..transforms import (
    JUMP_S,
    Insertion,
    InvalidTransformError,
    PastExtrapolationError,
    TransformBuffer,
    TransformError,
    ancestors,
)
from ..transforms.queue import Wait
from ..transforms.wire import WireTransforms, frame_name
from . import qos
from .topic_reader import TopicReader

_JUMP_NS = round(JUMP_S * SECOND)
_JUMPED = "time ran back a moment ago"


class TransformSource:
    """Transforms from TF, which is read in a thread of its own.

    `frames` are those whose poses relative to each other are looked up. Only the transforms on the way between them
    are kept over time (all, until it is known how they are linked); of every other frame just the newest. If a
    transform on the way jumps back in time, so has the recording, and all moving transforms are forgotten. Other frames
    may have clocks of their own.

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
        self._buffer = TransformBuffer()
        self._on_update, self._on_jump, self._on_bad = on_update, on_jump, on_bad
        self._frames = [frame.lstrip("/") for frame in frames]
        self._lock = threading.RLock()
        self._links: dict[bytes, _Link] = {}  # by the child's name as it travels
        self._between: set[str] = set()
        self._awaited: dict[tuple[str, str], int] = {}
        self._jumps: list[int] = []
        self._bad: list[str] = []
        self._node, self._closed = node, False
        self._wake = node.create_guard_condition(self._on_wake)
        self._reader = TopicReader(node)
        self._reader.subscribe(TFMessage, "/tf", lambda message: self._read(message, False), qos.TF_SUBSCRIBER)
        self._reader.subscribe(
            TFMessage, "/tf_static", lambda message: self._read(message, True), qos.TF_STATIC_SUBSCRIBER
        )
        self._reader.start()

    def close(self) -> None:
        """Stop listening; nothing is called after this."""
        self._reader.close()
        self._closed = True
        self._node.destroy_guard_condition(self._wake)

    def lookup(self, target: str, source: str, stamp: int) -> np.ndarray | Wait:
        """Return T_target_source (4, 4) at `stamp` [ns], both among `frames`, or `Wait` while it may still come.

        Raises PastExtrapolationError if the stamp lies before everything that is known.
        """
        with self._lock:
            if self._jumps:
                return Wait(_JUMPED)
            try:
                return self._buffer.lookup(target, source, stamp)
            except PastExtrapolationError:
                raise
            except TransformError as error:
                self._awaited[target, source] = min(stamp, self._awaited.get((target, source), stamp))
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
            return self._buffer.latest_common_stamp(target, source)

    def newest(self, target: str, source: str) -> np.ndarray:
        """Return T_target_source (4, 4) between any two frames, with each link on the way at its newest transform.

        Raises TransformError if they are not linked.
        """
        tree = TransformBuffer()
        with self._lock:
            for link in self._links.values():
                if link.last is not None:
                    with contextlib.suppress(InvalidTransformError):  # a bad one must not spoil all others
                        tree.insert(link.parent, link.child, 0, link.last.pose, static=True)
        return tree.lookup(target, source, 0)

    def rewind(self, stamp: int) -> None:
        """Follow the images' time back to `stamp` [ns]: forget transforms that come from before the jump."""
        with self._lock:
            if any((self._buffer.newest(frame) or stamp) > stamp + _JUMP_NS for frame in self._between):
                self._forget()

    def forget(self) -> None:
        """Forget all moving transforms, as after a jump of time that is too short to show in their stamps."""
        with self._lock:
            self._forget()

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

    # --- in the reader's thread

    def _read(self, message: bytes, static: bool) -> None:
        with self._lock:
            try:
                wire = WireTransforms(message)
                for parent, child, stamp, at in wire:
                    self._take(_Sample(wire, stamp, at), parent, child, static)
            except InputError as error:
                self._refuse(error, static)
            if self._jumps or self._bad or self._has_come():
                self._wake.trigger()

    def _take(self, sample: _Sample, parent: bytes, child: bytes, static: bool) -> None:
        link = self._links.get(child)
        try:
            if link is None or link.of != (parent, static):
                self._meet(_Link(parent, child, static), sample)
            elif link.on_the_way:
                self._insert(link, sample)
            else:
                link.last = sample
        except InvalidTransformError as error:
            self._refuse(error, static)

    def _refuse(self, error: Exception, static: bool) -> None:
        self._bad.append(f"{'/tf_static' if static else '/tf'}: {error}")

    def _meet(self, link: _Link, sample: _Sample) -> None:
        """Take a frame that is new or has a new parent, and find the way between `frames` again."""
        self._insert(link, sample)
        self._links[link.name] = link
        parents = {each.child: each.parent for each in self._links.values()}
        chains = [set(ancestors(frame, parents.get)) for frame in self._frames]
        common = set.intersection(*chains)
        self._between = set.union(*chains) - common
        for each in self._links.values():
            was_kept, each.on_the_way = each.on_the_way, not common or each.child in self._between
            if each.on_the_way and not was_kept and each.last is not None:
                with contextlib.suppress(InvalidTransformError):  # its next transform counts
                    self._insert(each, each.last)
        if common:
            self._buffer.keep(self._between)

    def _insert(self, link: _Link, sample: _Sample) -> None:
        """Keep a transform; if it jumped back in time between `frames`, forget those from before."""
        what = link.parent, link.child, sample.stamp, sample.pose, link.static
        if self._buffer.insert(*what) is Insertion.TIME_JUMP and link.child in self._between:
            self._jumps.append(sample.stamp)
            self._forget()
            self._buffer.insert(*what)
        link.last = sample

    def _has_come(self) -> bool:
        """Return, once for each, whether a transform that a `lookup` has to wait for is there."""
        come = []
        for frames, stamp in self._awaited.items():
            with contextlib.suppress(TransformError):
                newest = self._buffer.latest_common_stamp(*frames)
                if newest is None or newest >= stamp:
                    come.append(frames)
        for frames in come:
            del self._awaited[frames]
        return bool(come)

    def _forget(self) -> None:
        self._buffer.clear()
        for link in self._links.values():
            if not link.static:
                link.last = None


class _Sample(NamedTuple):
    """A transform in the message that brought it."""

    wire: WireTransforms
    stamp: int
    at: int

    @property
    def pose(self) -> tuple[float, ...]:
        return self.wire.pose(self.at)


class _Link:
    """State of a frame: its names, whether its transforms are kept over time, and the newest one."""

    def __init__(self, parent: bytes, child: bytes, static: bool):
        self.name, self.of, self.static = child, (parent, static), static
        self.parent, self.child = frame_name(parent), frame_name(child)
        self.on_the_way = True
        self.last: _Sample | None = None
