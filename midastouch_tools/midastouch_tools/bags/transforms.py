"""All transforms of a bag, in any recorded order."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from midastouch_common.errors import InputError
from midastouch_common.message_arrays import stamp_ns, xyzquat_from_msg
from midastouch_common.transforms import Insertion, TransformBuffer, TransformError

from .messages import TF_STATIC_TOPIC, TF_TOPIC, typestore
from .reader import bag_messages, readable

_FOREVER_S = 1e9
_LATEST_NS = 1_000_000_000  # largest delay of a transform behind those recorded before it


class _Track:
    """Stamps of one frame's transforms in recorded order.

    A late transform is sorted in by its stamp, unless it is late by more than `_LATEST_NS`. The frame's time runs
    backwards if its stamps cover more than that span a second time, as in a looped bag. Attributes: late and left_out:
    numbers of transforms; jump: stamp [ns] at which time first ran backwards.
    """

    def __init__(self) -> None:
        self.late = self.left_out = 0
        self.jump: float | None = None
        self._newest = self._again_from = -math.inf

    def too_late(self, stamp: int) -> bool:
        return stamp < self._newest - _LATEST_NS

    def add(self, stamp: int, is_used: bool) -> None:
        """Take note of the next valid transform."""
        self.left_out += not is_used
        if stamp > self._newest:
            self._newest, self._again_from = stamp, math.inf
            return
        self.late += is_used
        self._again_from = min(stamp, self._again_from)
        if self.jump is None and stamp - self._again_from > _LATEST_NS:
            self.jump = self._again_from


def recorded_transforms(path: Path, asked: Iterable[tuple[str, str]]) -> tuple[TransformBuffer, str]:
    """Return all transforms of a bag, and the reason why the last invalid one was refused (empty if none was).

    asked: pairs of frames. On the path between them, late or repeated transforms are reported on stderr, and time that
    runs backwards raises InputError. Other frames may have odd clocks.
    """
    buffer, refused = TransformBuffer(history_s=_FOREVER_S, jump_s=_FOREVER_S), ""
    unused = TransformBuffer()
    tracks: dict[str, _Track] = {}
    store = typestore()
    for message in bag_messages(path, {TF_TOPIC, TF_STATIC_TOPIC}):
        with readable(path):
            content: Any = store.deserialize_cdr(message.data, message.type_name)
        static = message.topic == TF_STATIC_TOPIC
        for item in content.transforms:
            stamp = stamp_ns(item.header.stamp)
            parent, child = item.header.frame_id.lstrip("/"), item.child_frame_id.lstrip("/")
            track = tracks.setdefault(child, _Track())
            into = unused if not static and track.too_late(stamp) else buffer
            try:
                outcome = into.insert(parent, child, stamp, xyzquat_from_msg(item.transform), static)
            except TransformError as error:
                refused = str(error)
                continue
            if not static:
                track.add(stamp, into is buffer and outcome is not Insertion.DUPLICATE)
    for target, source in asked:
        between = set(buffer.ancestors(target)) ^ set(buffer.ancestors(source))
        for child in sorted(tracks.keys() & between):
            _report(path, child, tracks[child])
    return buffer, refused


def _report(path: Path, frame: str, track: _Track) -> None:
    """Raise InputError if a frame's time runs backwards; otherwise report how many of its transforms are late."""
    if track.jump is not None:
        raise InputError(
            f"{path}: the time of frame '{frame}' runs backwards at {track.jump / 1e9:.3f} s; split the bag there"
        )
    if track.late or track.left_out:
        print(
            f"{path}: transforms of '{frame}': {track.late} late, sorted in; "
            f"{track.left_out} repeated or more than {_LATEST_NS / 1e9:g} s late, left out",
            file=sys.stderr,
        )
