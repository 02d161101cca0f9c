"""tf2_py for machines without it: it answers as the real one did when test/facts/tf2_jazzy.json was recorded."""

from __future__ import annotations

import math

from geometry_msgs.msg import TransformStamped
from rclpy.time import Time

from midastouch_filter.transforms.scalar_pose import IDENTITY, Pose, interpolate, invert, multiply

SECOND = 1_000_000_000


class TransformException(Exception):
    pass


class LookupException(TransformException):
    pass


class ConnectivityException(TransformException):
    pass


class ExtrapolationException(TransformException):
    pass


class InvalidArgumentException(TransformException):
    pass


class _Moving:
    """Samples (stamp, parent, pose), the newest first."""

    def __init__(self, history: int):
        self.samples: list[tuple[int, str, Pose]] = []
        self._history = history

    def insert(self, sample: tuple[int, str, Pose]) -> None:
        newest = self.samples[0][0] if self.samples else 0
        self.samples = [s for s in self.samples if s[0] + self._history >= newest]
        if self.samples and sample[0] < newest - self._history:
            return
        if sample not in self.samples:
            at = next((i for i, s in enumerate(self.samples) if s[0] <= sample[0]), len(self.samples))
            self.samples.insert(at, sample)

    def at(self, stamp: int) -> tuple[str, Pose] | str:
        """Parent and pose, or why there is none."""
        if not self.samples:
            return ""
        newest, oldest = self.samples[0], self.samples[-1]
        if stamp in (0, newest[0]):
            return newest[1:]
        if stamp == oldest[0]:
            return oldest[1:]
        if len(self.samples) == 1:
            return f"Lookup would require extrapolation, but only time {newest[0] / SECOND} is in the buffer"
        if not oldest[0] < stamp < newest[0]:
            return f"Lookup would require extrapolation into the {'future' if stamp > newest[0] else 'past'}"
        after = next(i for i, s in enumerate(self.samples) if s[0] <= stamp)
        (start, parent, a), (end, other, b) = self.samples[after], self.samples[after - 1]
        return parent, interpolate(a, b, (stamp - start) / (end - start)) if parent == other else a

    @property
    def latest(self) -> tuple[int, str]:
        return self.samples[0][:2] if self.samples else (0, "")


class _Static:
    def __init__(self, sample: tuple[int, str, Pose]):
        self._sample = sample

    def at(self, stamp: int) -> tuple[str, Pose]:
        return self._sample[1:]

    @property
    def latest(self) -> tuple[int, str]:
        return 0, self._sample[1]


class BufferCore:
    def __init__(self, cache_time):
        self._history = cache_time.nanoseconds
        self._frames: dict[str, _Moving | _Static | None] = {}
        self.given: list[str] = []  # the child of each transform, for tests

    def set_transform(self, msg, authority: str) -> None:
        self._set(msg, static=False)

    def set_transform_static(self, msg, authority: str) -> None:
        self._set(msg, static=True)

    def _set(self, msg, static: bool) -> None:
        parent, child = (name.removeprefix("/") for name in (msg.header.frame_id, msg.child_frame_id))
        p, q = msg.transform.translation, msg.transform.rotation
        norm = math.sqrt(q.x**2 + q.y**2 + q.z**2 + q.w**2)
        pose = (p.x, p.y, p.z, *(v / norm if norm else math.nan for v in (q.x, q.y, q.z, q.w)))
        self.given.append(child)
        if not parent or not child or parent == child or any(map(math.isnan, pose)):
            return
        if any(map(math.isinf, pose[:3])):
            pose = (math.nan, math.nan, math.nan, *pose[3:])  # as its matrices multiply
        sample = msg.header.stamp.sec * SECOND + msg.header.stamp.nanosec, parent, pose
        self._frames.setdefault(parent, None)
        if static:
            self._frames[child] = _Static(sample)
            return
        if not isinstance(self._frames.get(child), _Moving):
            self._frames[child] = _Moving(self._history)
        self._frames[child].insert(sample)

    def clear(self) -> None:
        for frame in self._frames.values():
            if isinstance(frame, _Moving):
                frame.samples.clear()

    def _require(self, frame: str) -> None:
        if "\0" in frame:
            raise ValueError("embedded null character")
        if not frame or frame.startswith("/"):
            raise InvalidArgumentException(f'Invalid argument "{frame}"')
        if frame not in self._frames:
            raise LookupException(f'"{frame}" does not exist.')

    def get_latest_common_time(self, target: str, source: str) -> Time:
        self._require(target)
        self._require(source)
        seconds, nanoseconds = divmod(self._latest_common(target, source), SECOND)
        return Time(seconds=seconds, nanoseconds=nanoseconds)

    def _latest_common(self, target: str, source: str) -> int:
        """Stamp; raises the base exception if the frames are not linked."""

        def climb(frame: str) -> dict[str, list[int]]:
            """Each frame above with the stamps on the way to it."""
            above, stamps = {frame: []}, []
            while (cache := self._frames[frame]) is not None and cache.latest[1] and len(above) < 1000:
                stamp, frame = cache.latest
                stamps = stamps + [stamp] * bool(stamp)
                if frame in above:
                    break
                above[frame] = stamps
            return above

        of_source, of_target = climb(source), climb(target)
        common = next((frame for frame in of_target if frame in of_source), None)
        if common is None:
            raise TransformException("not part of the same tree")
        return min(of_source[common] + of_target[common], default=0)

    def can_transform_core(self, target: str, source: str, time: Time) -> tuple[bool, str]:
        try:
            self.lookup_transform_core(target, source, time)
        except TransformException as error:
            return False, str(error)
        return True, ""

    def lookup_transform_core(self, target: str, source: str, time: Time) -> TransformStamped:
        pose = IDENTITY
        if target != source:
            self._require(target)
            self._require(source)
            pose = self._lookup(target, source, time.nanoseconds)
        out = TransformStamped()
        p, q = out.transform.translation, out.transform.rotation
        p.x, p.y, p.z, q.x, q.y, q.z, q.w = pose
        return out

    def _lookup(self, target: str, source: str, stamp: int) -> Pose:
        if stamp == 0:
            try:
                stamp = self._latest_common(target, source)
            except TransformException as error:
                raise ConnectivityException(str(error)) from None
        from_source, why = self._climb(source, stamp, until=target)
        if target in from_source:
            return from_source[target]
        top = list(from_source)[-1]
        from_target, why_not = self._climb(target, stamp, until=top)
        if source in from_target:
            return invert(from_target[source])
        if top in from_target:
            return multiply(invert(from_target[top]), from_source[top])
        if why_not is not None or why is not None:
            raise ExtrapolationException(why_not or why)
        raise ConnectivityException("not part of the same tree")

    def _climb(self, frame: str, stamp: int, until: str) -> tuple[dict[str, Pose], str | None]:
        """Each frame above with the first one's pose in it, and why it went no further, None at a root."""
        above, pose = {frame: IDENTITY}, IDENTITY
        while (cache := self._frames[frame]) is not None and frame != until:
            found = cache.at(stamp)
            if isinstance(found, str):
                return above, found
            frame = found[0]
            if frame in above:
                raise LookupException("The tf tree is invalid because it contains a loop.")
            pose = multiply(found[1], pose)
            above[frame] = pose
        return above, None
