"""Transforms at a stamp from `/tf` and `/tf_static`: by tf2 where it is installed, else by our own buffer."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass

import numpy as np
from rclpy.node import Node
from tf2_msgs.msg import TFMessage

from midastouch_perception.errors import InputError
from midastouch_perception.ros import qos
from midastouch_perception.ros.conversions import stamp_ns

from ..transforms import Insertion, InvalidTransformError, PastExtrapolationError, TransformError
from .transform_buffers import JUMP_NS, make_buffer


@dataclass(frozen=True)
class Wait:
    """The transform is not there yet but may still come; `reason` says what is missing."""

    reason: str


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
        self._buffer = make_buffer()
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
        if any(self._newest.get(frame, stamp) > stamp + JUMP_NS for frame in self._between()):
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
