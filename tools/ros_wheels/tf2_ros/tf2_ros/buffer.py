"""Trees of frames whose poses are known over time, with the answers of tf2.

Each frame has a history of its poses, in the parent of that time. A look-up interpolates every link on the way at the
requested stamp, then composes them. Nothing is extrapolated. Stamps are in ns; 0 means the latest common one.
"""

from __future__ import annotations

import math
import threading
from array import array
from bisect import bisect_left, bisect_right
from collections.abc import Callable
from typing import Any

from geometry_msgs.msg import TransformStamped
from rclpy.duration import Duration
from rclpy.logging import get_logger
from rclpy.time import Time

# Whatever is looked up live or in a recording is composed by the same code, to the same bits.
from midastouch_common.transforms.rigid import IDENTITY, Pose, interpolate, invert, multiply

_SECOND = 1_000_000_000
_LOOP = "The tf tree is invalid because it contains a loop."


class TransformException(Exception):
    """Base of all refusals."""


class LookupException(TransformException):
    """A frame is unknown, or the frames form a loop."""


class ConnectivityException(TransformException):
    """No chain of transforms links the two frames."""


class ExtrapolationException(TransformException):
    """The stamp is outside of the history of a link."""


class InvalidArgumentException(TransformException):
    """A frame's name is empty or begins with a slash."""


class _Static:
    """A frame's parent and pose at any stamp."""

    def __init__(self, parent: str, pose: Pose):
        self.newest, self._sample = (parent, 0), (parent, pose)

    def at(self, stamp: int) -> tuple[str, Pose]:
        return self._sample


class _Moving:
    """A frame's parents and poses, sorted by stamp, for `cache_time` [ns] before the newest.

    They are in arrays, as Python's garbage collection would look through 100,000 tuples, which takes 50 ms and more.
    """

    def __init__(self, cache_time: int):
        self._cache_time = cache_time
        self.clear()

    def clear(self) -> None:
        self._first = 0  # index of the oldest sample; those before it have expired
        self._stamps, self._poses, self._parents = array("q"), array("d"), []

    @property
    def newest(self) -> tuple[str, int] | None:
        """The parent at the newest stamp, and that stamp."""
        return (self._parents[-1], self._stamps[-1]) if self._stamps else None

    def insert(self, stamp: int, parent: str, pose: Pose) -> bool:
        """Sort in a sample; return False if it is too old. A repeated one changes nothing."""
        stamps = self._stamps
        if stamps:
            self._expire(oldest := stamps[-1] - self._cache_time)
            if stamp < oldest:
                return False
        at = bisect_right(stamps, stamp, self._first)
        for same in range(bisect_left(stamps, stamp, self._first), at):
            if self._sample(same) == (parent, pose):
                return True
        stamps.insert(at, stamp)
        self._parents.insert(at, parent)
        self._poses[7 * at : 7 * at] = array("d", pose)
        return True

    def _expire(self, oldest: int) -> None:
        self._first = first = bisect_left(self._stamps, oldest, self._first)
        if first > len(self._stamps) // 2:  # seldom: the others have to move
            del self._stamps[:first], self._parents[:first], self._poses[: 7 * first]
            self._first = 0

    def _sample(self, index: int) -> tuple[str, Pose]:
        return self._parents[index], tuple(self._poses[7 * index : 7 * index + 7])

    def at(self, stamp: int) -> tuple[str, Pose]:
        """Return parent and pose at a stamp; raises ExtrapolationException outside of the history."""
        stamps = self._stamps
        if not stamps:
            raise ExtrapolationException("the history is empty")
        oldest, newest = stamps[self._first], stamps[-1]
        if stamp in (0, newest):
            return self._sample(len(stamps) - 1)
        if stamp == oldest:
            return self._sample(self._first)
        if not oldest < stamp < newest:
            where = "past" if stamp < oldest else "future"
            span = f"{oldest / _SECOND:.6f} to {newest / _SECOND:.6f}"
            asked = f"Requested time {stamp / _SECOND:.6f} but the data is from {span}"
            raise ExtrapolationException(f"Lookup would require extrapolation into the {where}.  {asked}")
        after = bisect_right(stamps, stamp, self._first)
        start, end = stamps[after - 1], stamps[after]
        (parent, before), (next_parent, behind) = self._sample(after - 1), self._sample(after)
        if start == stamp or parent != next_parent:
            return parent, before
        return parent, interpolate(before, behind, (stamp - start) / (end - start))


_Link = _Static | _Moving


class Buffer:
    """Buffer of transforms, safe to use from several threads. Args: cache_time, 10 s by default."""

    def __init__(self, cache_time: Duration | None = None):
        self._cache_time = 10 * _SECOND if cache_time is None else cache_time.nanoseconds
        self._links: dict[str, _Link | None] = {}  # all frames by name; None for a root
        self._lock = threading.RLock()
        self._log = get_logger("tf2")

    def set_transform(self, transform: TransformStamped, authority: str) -> None:
        """Store a transform at its stamp; one that cannot be used is logged and ignored."""
        self._set(transform, authority, static=False)

    def set_transform_static(self, transform: TransformStamped, authority: str) -> None:
        """Store a transform that holds at any stamp, in place of the former ones of its frame."""
        self._set(transform, authority, static=True)

    def _set(self, transform: TransformStamped, authority: str, static: bool) -> None:
        parent, child = transform.header.frame_id.removeprefix("/"), transform.child_frame_id.removeprefix("/")
        p, q = transform.transform.translation, transform.transform.rotation
        norm = math.sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w)
        if not parent or not child or parent == child or not norm or math.isnan(norm + p.x + p.y + p.z):
            self._ignore(f"TF_INVALID_INPUT: Ignoring transform '{parent}' -> '{child}' from authority \"{authority}\"")
            return
        pose = (p.x, p.y, p.z, q.x / norm, q.y / norm, q.z / norm, q.w / norm)
        with self._lock:
            self._links.setdefault(parent, None)
            if static:
                self._links[child] = _Static(parent, pose)
                return
            link = self._links.get(child)
            if not isinstance(link, _Moving):
                link = self._links[child] = _Moving(self._cache_time)
            stamp = transform.header.stamp
            if not link.insert(stamp.sec * _SECOND + stamp.nanosec, parent, pose):
                self._ignore(f"TF_OLD_DATA ignoring data from the past for frame {child} according to {authority}")

    def _ignore(self, reason: str) -> None:
        self._log.warning(reason, throttle_duration_sec=1.0)

    def clear(self) -> None:
        """Forget the moving transforms; static ones, which are sent only once, and names are kept."""
        with self._lock:
            for link in self._links.values():
                if isinstance(link, _Moving):
                    link.clear()

    def lookup_transform(self, target_frame: str, source_frame: str, time: Time) -> TransformStamped:
        """Return T_target_source at a time; raises a TransformException if it is not known."""
        with self._lock:
            stamp, pose = self._find(target_frame, source_frame, time.nanoseconds)
        found = TransformStamped(child_frame_id=source_frame)
        found.header.frame_id, found.header.stamp = target_frame, Time(nanoseconds=stamp).to_msg()
        p, q = found.transform.translation, found.transform.rotation
        p.x, p.y, p.z, q.x, q.y, q.z, q.w = pose
        return found

    def get_latest_common_time(self, target_frame: str, source_frame: str) -> Time:
        """Return the newest time at which a look-up succeeds; 0 if only static transforms link the frames."""
        with self._lock:
            self._require_known(target_frame, source_frame)
            try:
                return Time(nanoseconds=self._latest_common(target_frame, source_frame))
            except TransformException as error:
                raise TransformException(str(error)) from None

    def _require_known(self, *frames: str) -> None:
        for frame in frames:
            if "\0" in frame:
                raise ValueError("embedded null character")
            if not frame or frame.startswith("/"):
                raise InvalidArgumentException(f"'{frame}': in tf2 frame_ids cannot be empty nor start with a '/'")
            if frame not in self._links:
                raise LookupException(f"frame '{frame}' does not exist")

    def _find(self, target: str, source: str, stamp: int) -> tuple[int, Pose]:
        """Return the stamp, which is not 0 if any link moves, and T_target_source at it."""
        if target != source:
            self._require_known(target, source)
        stamp = stamp or self._latest_common(target, source)
        in_common = []
        for way in self._ways(target, source, lambda frame: (link := self._links[frame]) and link.at(stamp)):
            pose = IDENTITY
            for step in way:
                pose = multiply(step, pose)
            in_common.append(pose)
        return stamp, multiply(invert(in_common[0]), in_common[1])

    def _latest_common(self, target: str, source: str) -> int:
        def newest(frame: str) -> tuple[str, int] | None:
            return (link := self._links.get(frame)) and link.newest

        if target == source:
            return (newest(target) or (target, 0))[1]
        return min((stamp for way in self._ways(target, source, newest) for stamp in way if stamp), default=0)

    def _ways(self, target: str, source: str, step: Callable[[str], tuple[str, Any] | None]) -> tuple[list, list]:
        """Return the values of the links from the target, and from the source, up to a frame that is above both.

        step: frame -> parent and value; None for a root; raises ExtrapolationException.
        """
        ways: dict[str, list] = {source: []}
        no_way: TransformException = ConnectivityException(
            f"Could not find a connection between '{target}' and '{source}': they are not part of the same tree."
        )
        frame = source
        try:
            while frame != target and (found := step(frame)):
                if found[0] in ways:
                    raise LookupException(_LOOP)
                ways[found[0]] = [*ways[frame], found[1]]
                frame = found[0]
        except ExtrapolationException as error:  # the target may be below
            no_way = error
        way, frame = [], target
        while frame not in ways:
            if not (found := step(frame)):
                raise no_way
            if len(way) > len(self._links):
                raise LookupException(_LOOP)
            frame = found[0]
            way.append(found[1])
        return way, ways[frame]
