"""A bag as a table: one row per frame, in columns that every format writes."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.message_arrays import image_from_msg, pose_from_msg
from midastouch_filter.core.state import STATES

from ..bags.images import OWN, BagFrame, GelStream, image_messages, read_bag
from ..bags.messages import header_stamp_ns
from ..bags.reader import bag_metadata, bag_topics, readable
from ..bags.run_record import PENETRATION, POSE, STATUS, answers, by_stamp

FILTER_STATES = ("none", *STATES)
"""Names of the numbers in the column `filter_state`; `none`: the filter reported nothing about the frame."""

POSE_NAMES = ("x", "y", "z", "qx", "qy", "qz", "qw")
_NOWHERE = np.array([0, 0, 0, 0, 0, 0, 1.0])


@dataclasses.dataclass(frozen=True)
class RecordedFrame:
    """One image with the results of its stamp; None, or the state "none", for results that the bag does not have.

    estimate: T_obj_gel (4, 4); penetration (H, W): float32 m, as measured.
    """

    posed: BagFrame
    penetration: np.ndarray | None
    estimate: np.ndarray | None
    state: str


@dataclasses.dataclass(frozen=True)
class Column:
    """A quantity that every frame has.

    Attributes: name; dtype: of NumPy; shape: of one value; description: with unit; value: function of a frame; names:
    of the elements of a vector.
    """

    name: str
    dtype: str
    shape: tuple[int, ...]
    description: str
    value: Callable[[RecordedFrame], np.ndarray]
    names: tuple[str, ...] = ()


class Recording:
    """Frames of a stream of a bag, read from the file each time they are asked for.

    Attributes: path; object_name: empty if the bag does not name it; columns. Raises InputError if `path` is no bag
    with such images and transforms.
    """

    def __init__(self, path: str | Path, stream: GelStream = OWN):
        self.path, self._stream = Path(path), stream
        self._topics = {topic.name for topic in bag_topics(path)}
        self.object_name = bag_metadata(path).get("object", "")
        self.columns = tuple(self._find_columns(next(self.frames())))

    @property
    def rate(self) -> float:
        """Images per second, from the median interval. Raises InputError for fewer than two images."""
        with readable(self.path):
            stamps = [header_stamp_ns(message.data) for message in image_messages(self.path, self._stream.image_topic)]
        distinct = np.unique(stamps)
        if len(distinct) < 2:
            raise InputError(f"{self.path}: one image is no recording; record a slide")
        return 1e9 / float(np.median(np.diff(distinct)))

    def frames(self) -> Iterator[RecordedFrame]:
        """Yield frame by frame; an image that was recorded twice comes once."""
        estimates = dict(by_stamp(self.path, POSE)) if POSE in self._topics else {}
        states = answers(self.path) if STATUS in self._topics else {}
        measured = _InOrder(by_stamp(self.path, PENETRATION) if PENETRATION in self._topics else iter(()))
        newest = -1
        for posed in read_bag(self.path, self._stream):
            stamp = posed.stamp_ns
            if stamp <= newest:
                continue
            newest = stamp
            pose, status, penetration = estimates.get(stamp), states.get(stamp), measured.at(stamp)
            yield RecordedFrame(
                posed,
                None if penetration is None else image_from_msg(penetration).astype(np.float32),
                None if pose is None else pose_from_msg(pose.pose.pose),
                "none" if status is None else status.state,
            )

    def rows(self) -> Iterator[dict[str, np.ndarray]]:
        """Yield, frame by frame, the value of each column in the column's type and shape."""
        for frame in self.frames():
            row = {column.name: np.asarray(column.value(frame), column.dtype) for column in self.columns}
            for column in self.columns:
                if row[column.name].shape != column.shape:
                    wrong = f"{column.name} of {row[column.name].shape} after some of {column.shape}"
                    raise InputError(f"{self.path}: {wrong}; export the parts of one sensor apart")
            yield row

    def _find_columns(self, first: RecordedFrame) -> Iterator[Column]:
        yield Column("stamp_ns", "int64", (1,), "time of the image [ns]", lambda f: np.array([f.posed.stamp_ns]))
        yield Column("image", "uint8", first.posed.image.shape, "tactile image, RGB", lambda f: f.posed.image)
        yield _pose("base_from_gel", "gel frame in the base of the arm", lambda f: f.posed.base_from_gel)
        # a bag may list a topic without messages
        if PENETRATION in self._topics and (measured := next(by_stamp(self.path, PENETRATION), None)):
            nothing = np.zeros_like(image_from_msg(measured[1]), np.float32)
            what = "how far the object is in the gel, as the depth network measures it [m]"
            whole = Column("penetration", "float32", nothing.shape, what, lambda f: f.penetration)
            yield from _where_known(whole, nothing)
        if POSE in self._topics:
            of_filter = "gel frame on the object, where the filter believes it most"
            yield from _where_known(_pose("estimate", of_filter, lambda f: f.estimate), _NOWHERE)
        if STATUS in self._topics:
            numbers = ", ".join(f"{i} {name}" for i, name in enumerate(FILTER_STATES))
            state = lambda f: np.array([FILTER_STATES.index(f.state)])  # noqa: E731
            yield Column("filter_state", "int64", (1,), f"what the filter knows: {numbers}", state)
        if first.posed.object_from_gel_true is not None:
            true = _pose("truth", "gel frame on the object in truth", lambda f: f.posed.object_from_gel_true)
            yield from _where_known(true, _NOWHERE)


def _pose(name: str, what: str, pose: Callable[[RecordedFrame], np.ndarray | None]) -> Column:
    def value(frame: RecordedFrame) -> np.ndarray | None:
        transform = pose(frame)
        return None if transform is None else se3.to_xyzquat(transform)

    return Column(name, "float64", (7,), f"{what}: position [m], quaternion", value, POSE_NAMES)


def _where_known(column: Column, missing: np.ndarray) -> tuple[Column, Column]:
    """Return the column with `missing` in place of None, and a column that is True for the frames with a value."""

    def value(frame: RecordedFrame) -> np.ndarray:
        known = column.value(frame)
        return missing if known is None else known

    def valid(frame: RecordedFrame) -> np.ndarray:
        return np.array([column.value(frame) is not None])

    says = f"whether the frame has {column.name}"
    return dataclasses.replace(column, value=value), Column(f"{column.name}_valid", "bool", (1,), says, valid)


class _InOrder:
    """Large values by stamp, asked for in order of time, so that only the present one is held in memory."""

    def __init__(self, values: Iterator[tuple[int, object]]):
        self._values = values
        self._present = next(values, None)

    def at(self, stamp: int) -> object | None:
        while self._present is not None and self._present[0] < stamp:
            self._present = next(self._values, None)
        return self._present[1] if self._present is not None and self._present[0] == stamp else None
