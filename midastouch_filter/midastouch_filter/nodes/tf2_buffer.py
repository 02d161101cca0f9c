"""tf2 behind the interface of our own transform buffer, where it is installed."""

from __future__ import annotations

import numpy as np
from geometry_msgs.msg import TransformStamped
from rclpy.duration import Duration
from rclpy.time import Time

from midastouch_common.message_arrays import transform_from_msg
from midastouch_common.ros.conversions import stamp_from_ns

from ..transforms import SECOND, FrameTree, Link, PastExtrapolationError, TransformBuffer, TransformError
from ..transforms.scalar_pose import Pose

try:
    import tf2_py
except ImportError:  # the PyPI wheels have no tf2
    tf2_py = None

_AUTHORITY = "midastouch"


def make_buffer() -> FrameTree:
    """One that tf2 keeps if tf2 is there, else our own."""
    return Tf2Buffer() if tf2_py is not None else TransformBuffer()


class Tf2Buffer(FrameTree):
    """A tree whose poses tf2 keeps, interpolates and composes.

    The rules are ours, for tf2 tells neither early from late nor a jump of time, and has one exception for many
    reasons: what it is asked here it can answer.
    """

    def __init__(self):
        super().__init__()
        self._core = tf2_py.BufferCore(Duration(nanoseconds=self._history))
        self._refusals = tf2_py.TransformException, ValueError

    def _make_link(self, parent: str, child: str, static: bool) -> Link:
        return _Tf2Link(self._core, parent, child, static, self._history)

    def _pose(self, target: list[str], source: list[str], stamp: int, names: tuple[str, str]) -> np.ndarray:
        if stamp <= 0:
            raise PastExtrapolationError(f"stamp {stamp / SECOND:g} s: not after the epoch; 0 means the newest to tf2")
        try:
            return transform_from_msg(self._core.lookup_transform_core(*names, Time(nanoseconds=stamp)).transform)
        except self._refusals as error:
            raise TransformError(f"tf2: {error}") from error


class _Tf2Link(Link):
    """Stamps of the transforms that tf2 was given of one frame."""

    def __init__(self, core, parent: str, child: str, static: bool, history: int):
        super().__init__(parent, static, history)
        self._core = core
        # filled anew for each: to make a message costs more than tf2 itself
        self._message = TransformStamped(child_frame_id=child)
        self._message.header.frame_id = parent

    def _store(self, at: int, stamp: int, pose: Pose) -> None:
        message = self._message
        message.header.stamp = stamp_from_ns(stamp)
        p, q = message.transform.translation, message.transform.rotation
        p.x, p.y, p.z, q.x, q.y, q.z, q.w = pose
        if self.static or not self._stamps:
            # tf2 forgets a single frame only when that becomes static
            self._core.set_transform_static(message, _AUTHORITY)
        if not self.static:
            self._core.set_transform(message, _AUTHORITY)

    def _drop(self, count: int) -> None:
        """tf2 does so by itself."""
