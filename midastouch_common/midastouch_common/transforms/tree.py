"""Trees of frames, and checks of the transforms on their way to tf2, which leaves these out."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from ..message_arrays import SECOND
from .rigid import Pose, TransformError, checked_pose

# A transform that is older than its frame's newest by more than this [ns] is no late one: time has run back.
_JUMP_NS = SECOND


class FrameTree:
    """Frames by name, each with its latest parent. Attributes: parents, by child."""

    def __init__(self) -> None:
        self.parents: dict[str, str] = {}

    def link(self, parent: str, child: str, pose: Sequence[float]) -> Pose:
        """Link two frames by a pose [x y z qx qy qz qw], and return it with a unit quaternion.

        Raises TransformError if the pose is not rigid, or if the link would close a loop.
        """
        valid = checked_pose(parent, child, pose)
        if self.parents.get(child) != parent:
            if child in self.ancestors(parent):
                raise TransformError(f"transform '{parent}' -> '{child}' closes a loop")
            self.parents[child] = parent
        return valid

    def ancestors(self, frame: str) -> list[str]:
        """Return the frame, its parent, ... up to its root, which has no parent; in a loop each frame comes once."""
        chain = {frame: None}
        while (frame := self.parents.get(frame)) is not None and frame not in chain:
            chain[frame] = None
        return list(chain)


class TransformWatch(FrameTree):
    """Watch over the time of a tree: on the way between `frames` it is the recording's, elsewhere anything."""

    def __init__(self, frames: Collection[str]):
        super().__init__()
        self._frames = list(frames)
        self._newest: dict[str, int] = {}  # stamps [ns] of moving frames

    def has_jumped(self, child: str, stamp: int) -> bool:
        """Take note of a moving frame's next stamp [ns]; return whether the recording has jumped back to it."""
        newest = self._newest.get(child, stamp)
        if stamp >= newest - _JUMP_NS:
            self._newest[child] = max(stamp, newest)
            return False
        if jumped := child in self._between():
            self.forget()
        self._newest[child] = stamp
        return jumped

    def is_ahead(self, stamp: int) -> bool:
        """Return whether a transform on the way is from so long after `stamp` [ns] that time has run back since."""
        return any(self._newest.get(frame, stamp) > stamp + _JUMP_NS for frame in self._between())

    def forget(self) -> None:
        """Forget the stamps, but not the tree."""
        self._newest.clear()

    def _between(self) -> set[str]:
        chains = [set(self.ancestors(frame)) for frame in self._frames]
        return chains[0].union(*chains) - chains[0].intersection(*chains)
