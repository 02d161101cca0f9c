"""A bag as a table: one row per frame, in columns that every format writes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.message_arrays import image_from_msg, pose_from_msg
from midastouch_filter.core.state import STATES

from ..bags.images import OWN, GelStream, image_messages, read_bag
from ..bags.messages import header_stamp_ns
from ..bags.reader import bag_metadata, bag_topics, readable
from ..bags.run_record import PENETRATION, POSE, STATUS, answers, by_stamp

FILTER_STATES = ("none", *STATES)
"""Names of the numbers in the column `filter_state`; `none`: the filter reported nothing about the frame."""

POSE_NAMES = ("x", "y", "z", "qx", "qy", "qz", "qw")
_NOWHERE = np.array([0, 0, 0, 0, 0, 0, 1.0])
_IS_POSE = "position [m], quaternion"

# type in NumPy, and description with unit, by name of the column
_COLUMNS = {
    "stamp_ns": ("int64", "time of the image [ns]"),
    "image": ("uint8", "tactile image, RGB"),
    "base_from_gel": ("float64", f"gel frame in the base of the arm: {_IS_POSE}"),
    "penetration": ("float32", "how far the object reaches above the outline of its contact, as measured [m]"),
    "penetration_valid": ("bool", "whether the frame has penetration"),
    "estimate": ("float64", f"gel frame on the object, where the filter believes it most: {_IS_POSE}"),
    "estimate_valid": ("bool", "whether the frame has estimate"),
    "filter_state": (
        "int64", "what the filter knows: " + ", ".join(f"{i} {name}" for i, name in enumerate(FILTER_STATES))
    ),
    "truth": ("float64", f"gel frame on the object in truth: {_IS_POSE}"),
    "truth_valid": ("bool", "whether the frame has truth"),
}  # fmt: skip


@dataclass(frozen=True)
class Column:
    """A quantity that every frame has.

    Attributes: name; dtype: of NumPy; shape: of one value; description: with unit; names: of the elements of a vector.
    """

    name: str
    dtype: str
    shape: tuple[int, ...]
    description: str
    names: tuple[str, ...] = ()


class Recording:
    """Frames of a stream of a bag, read from the file each time they are asked for.

    Attributes: path; object_name: empty if the bag does not name it; columns: those for which the bag has values.
    Raises InputError if `path` is no bag with such images and transforms.
    """

    def __init__(self, path: str | Path, stream: GelStream = OWN):
        self.path, self._stream = Path(path), stream
        self._topics = {topic.name for topic in bag_topics(path)}
        self.object_name = bag_metadata(path).get("object", "")
        self.columns: tuple[Column, ...] = ()
        self.columns = tuple(_column(name, value.shape) for name, value in next(self.rows()).items())

    @property
    def rate(self) -> float:
        """Images per second, from the median interval. Raises InputError for fewer than two images."""
        with readable(self.path):
            stamps = [header_stamp_ns(message.data) for message in image_messages(self.path, self._stream.image_topic)]
        distinct = np.unique(stamps)
        if len(distinct) < 2:
            raise InputError(f"{self.path}: one image is no recording; record a slide")
        return 1e9 / float(np.median(np.diff(distinct)))

    def rows(self) -> Iterator[dict[str, np.ndarray]]:
        """Yield, frame by frame, the value of each column in the column's type and shape.

        An image that was recorded twice comes once. A value that a frame lacks is zero, or the identity, and its column
        `..._valid` is False. Raises InputError if the shape of a value changes.
        """
        for values in self._values():
            row = {name: np.asarray(value, _COLUMNS[name][0]) for name, value in values.items()}
            for column in self.columns:
                if row[column.name].shape != column.shape:
                    wrong = f"{column.name} of {row[column.name].shape} after some of {column.shape}"
                    raise InputError(f"{self.path}: {wrong}; export the parts of one sensor apart")
            yield row

    def _values(self) -> Iterator[dict]:
        """Yield, frame by frame, what the bag has for each column."""
        estimates = {at: se3.to_xyzquat(pose_from_msg(msg.pose.pose)) for at, msg in self._by_stamp(POSE)}
        states = answers(self._by_stamp(STATUS))
        # a bag may list a topic without messages
        first_map = next(self._by_stamp(PENETRATION), None)
        untouched = None if first_map is None else np.zeros_like(image_from_msg(first_map[1]))
        measured = _InOrder(self._by_stamp(PENETRATION))
        newest, has_truth = -1, None
        for posed in read_bag(self.path, self._stream):
            stamp, truth = posed.stamp_ns, posed.object_from_gel_true
            if stamp <= newest:
                continue
            newest, has_truth = stamp, truth is not None if has_truth is None else has_truth
            row = {"stamp_ns": [stamp], "image": posed.image, "base_from_gel": se3.to_xyzquat(posed.base_from_gel)}
            if untouched is not None:
                penetration = None if (image := measured.at(stamp)) is None else image_from_msg(image)
                row |= _where_known("penetration", penetration, untouched)
            if POSE in self._topics:
                row |= _where_known("estimate", estimates.get(stamp), _NOWHERE)
            if STATUS in self._topics:
                row["filter_state"] = [FILTER_STATES.index(states[stamp].state if stamp in states else "none")]
            if has_truth:
                row |= _where_known("truth", None if truth is None else se3.to_xyzquat(truth), _NOWHERE)
            yield row

    def _by_stamp(self, topic: str) -> Iterator[tuple[int, Any]]:
        return by_stamp(self.path, topic) if topic in self._topics else iter(())


def _column(name: str, shape: tuple[int, ...]) -> Column:
    dtype, description = _COLUMNS[name]
    return Column(name, dtype, shape, description, POSE_NAMES if description.endswith(_IS_POSE) else ())


def _where_known(name: str, value: np.ndarray | None, missing: np.ndarray) -> dict:
    """Return the value, or `missing` for None, and whether it is known."""
    return {name: missing if value is None else value, f"{name}_valid": [value is not None]}


class _InOrder:
    """Large values by stamp, asked for in order of time, so that only the present one is held in memory."""

    def __init__(self, values: Iterator[tuple[int, Any]]):
        self._values = values
        self._present = next(values, None)

    def at(self, stamp: int) -> Any | None:
        while self._present is not None and self._present[0] < stamp:
            self._present = next(self._values, None)
        return self._present[1] if self._present is not None and self._present[0] == stamp else None
