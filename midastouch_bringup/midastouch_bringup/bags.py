"""rosbag2 files (MCAP): write a sequence or a recording, read one back frame by frame. Needs no ROS.

A path that ends in `.mcap` is one file; any other is a rosbag2 folder with its `metadata.yaml`. `ros2 bag`
reads both.
"""

from __future__ import annotations

import contextlib
import math
import shutil
import sys
import tempfile
from collections.abc import Collection, Iterable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import cv2
import mcap.reader
import numpy as np
import yaml
from rosbags.highlevel import AnyReader
from rosbags.interfaces import (
    Connection,
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

from midastouch_filter.transforms import (
    Insertion,
    TransformBuffer,
    TransformError,
    ancestors,
)
from midastouch_perception.errors import InputError
from midastouch_perception.files import naming
from midastouch_perception.message_arrays import rgb_from_msg, stamp_ns, xyzquat_from_msg

from .datasets import Sequence
from .messages import (
    BASE_FRAME,
    COMPRESSED_TYPE,
    GEL_FRAME,
    IMAGE_TOPIC,
    IMAGE_TYPE,
    TF_STATIC_TOPIC,
    TF_TOPIC,
    TRUTH_FRAME,
    TRUTH_GEL_FRAME,
    Message,
    Topic,
    header_stamp_ns,
    sequence_messages,
    typestore,
)

_FOREVER_S = 1e9
_LATEST_NS = 1_000_000_000  # of a transform behind those that were recorded before it
_UNSET = QosTime(0, 0)


class BagWriter:
    """Writes messages of any known type into a new bag: `with BagWriter(path) as bag: bag.write(message)`.

    The bag appears at `path`, replacing an older one, when the block ends well; if it fails nothing is left.
    `metadata` are texts by name, kept in the bag's custom data. Raises InputError if something that is no bag
    is at `path`.
    """

    def __init__(self, path: str | Path, metadata: dict[str, str] | None = None) -> None:
        self._path = Path(path)
        self._metadata = metadata or {}
        self._connections: dict[str, Connection] = {}
        if self._path.exists() and not is_bag(self._path):
            raise InputError(f"{self._path}: exists and is not a bag; choose another name")

    def __enter__(self) -> BagWriter:
        self._path.parent.mkdir(parents=True, exist_ok=True)
        with contextlib.ExitStack() as cleanup:
            folder = cleanup.enter_context(
                tempfile.TemporaryDirectory(prefix=f".{self._path.name}.", dir=self._path.parent)
            )
            # the writer names the file inside after its folder, so the folder has the final name
            self._writer = Writer(Path(folder) / self._path.stem, version=9, storage_plugin=StoragePlugin.MCAP)
            self._writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
            for key, value in self._metadata.items():
                self._writer.set_custom_data(key, value)
            self._writer.open()
            self._cleanup = cleanup.pop_all()
        return self

    def write(self, message: Message) -> None:
        """Append a message; its topic is added when it first comes."""
        connection = self._connections.get(message.topic)
        if connection is None:
            connection = self._connections[message.topic] = self._writer.add_connection(
                message.topic,
                message.type_name,
                typestore=typestore(),
                offered_qos_profiles=[_offered_qos(message.latched)],
            )
        with naming(self._path):
            self._writer.write(connection, message.stamp_ns, message.data)

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        with self._cleanup:
            if kind is not None:
                self._writer.abort()
                return
            with naming(self._path):
                self._writer.close()
            written = self._writer.path
            if self._path.suffix == ".mcap":
                (written / f"{written.name}.mcap").replace(self._path)
                return
            if self._path.exists():
                shutil.rmtree(self._path)
            written.replace(self._path)


def _offered_qos(latched: bool) -> Qos:
    """What the recorded publisher offered; `ros2 bag play` offers the same."""
    return Qos(
        history=QosHistory.KEEP_LAST,
        depth=1 if latched else 10,
        reliability=QosReliability.RELIABLE,
        durability=QosDurability.TRANSIENT_LOCAL if latched else QosDurability.VOLATILE,
        deadline=_UNSET,
        lifespan=_UNSET,
        liveliness=QosLiveliness.AUTOMATIC,
        liveliness_lease_duration=_UNSET,
        avoid_ros_namespace_conventions=False,
    )


def write_bag(sequence: Sequence, path: str | Path) -> None:
    """Convert a sequence to a bag at `path`: image, camera info, transforms, ground truth on its frame."""
    metadata = {"object": sequence.object_name, "sequence": sequence.name, "layout": sequence.layout}
    with BagWriter(path, metadata) as bag:
        for message in sequence_messages(sequence):
            bag.write(message)


def is_bag(path: str | Path) -> bool:
    """Whether `path` looks like a bag: an .mcap or .db3 file, or a folder with `metadata.yaml`."""
    path = Path(path)
    return (path / "metadata.yaml").is_file() or (path.is_file() and path.suffix in (".mcap", ".db3"))


def bag_metadata(path: str | Path) -> dict[str, str]:
    """The custom data of a bag, such as `object` and `sequence`; empty for a bag that has none."""
    path = Path(path)
    with readable(path):
        if path.is_dir():
            content = yaml.safe_load((path / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
            return content.get("custom_data") or {}
        with path.open("rb") as stream:
            for record in mcap.reader.make_reader(stream).iter_metadata():
                if record.name == "rosbag2":
                    return yaml.safe_load(record.metadata["serialized_metadata"]).get("custom_data") or {}
    return {}


class BagFrame(NamedTuple):
    """One image of a bag with the poses at its stamp.

    stamp_ns: of the image's header; image: (320, 240, 3) uint8 RGB; base_from_gel: T_base_gel (4, 4);
    object_from_gel_true: T_obj_gel (4, 4) from the ground truth frames, None if the bag has none.
    """

    stamp_ns: int
    image: np.ndarray
    base_from_gel: np.ndarray
    object_from_gel_true: np.ndarray | None


def read_bag(
    path: str | Path,
    image_topic: str = IMAGE_TOPIC,
    base_frame: str = BASE_FRAME,
    gel_frame: str = GEL_FRAME,
) -> Iterator[BagFrame]:
    """Every image of a bag whose stamp the transforms span, in recorded order, deterministically.

    All transforms are read first, then interpolated at each image's stamp, so nothing depends on the order in
    which images and transforms were recorded. Images before the first or after the last transform are left
    out, and transforms that are none (not finite, no unit quaternion), as the filter's node leaves them out.
    Transforms that are late or repeated are told on stderr. Raises InputError if the bag cannot be read, lacks the
    topic or the transforms, or if the time of a frame runs backwards on which the gel's or the true pose depends.
    """
    path = Path(path)
    transforms, refused = _all_transforms(path, ((base_frame, gel_frame), (TRUTH_FRAME, TRUTH_GEL_FRAME)))
    used, reason = False, "it is empty"
    for message in bag_messages(path, {image_topic}):
        with readable(path):
            stamp = header_stamp_ns(message.data)
        try:
            pose = transforms.lookup(base_frame, gel_frame, stamp)
        except TransformError as error:
            reason = "; ".join(filter(None, (str(error), refused)))
            continue
        used = True
        yield BagFrame(stamp, decode_image(message, path), pose, _true_pose(transforms, stamp))
    if not used:
        raise InputError(f"{path}: no image on {image_topic} has a pose ({reason}); record /tf and /tf_static")


def bag_topics(path: str | Path) -> list[Topic]:
    """The topics of a bag. Raises InputError if it cannot be read."""
    path = Path(path)
    with readable(path), AnyReader([path]) as reader:
        return [Topic(c.topic, c.msgtype, _was_latched(c)) for c in reader.connections]


def bag_duration(path: str | Path) -> float:
    """Seconds from the first message of a bag to the last. Raises InputError if it cannot be read."""
    path = Path(path)
    with readable(path), AnyReader([path]) as reader:
        return reader.duration / 1e9 if reader.message_count else 0.0


def bag_messages(path: str | Path, topics: Collection[str] = ()) -> Iterator[Message]:
    """The messages of a bag on some topics (all if none is named) in order of recording.

    Raises InputError if the bag cannot be read or has none of the topics.
    """
    path = Path(path)
    with readable(path), AnyReader([path]) as reader:
        chosen = [c for c in reader.connections if not topics or c.topic in topics]
        if not chosen:
            present = ", ".join(sorted({c.topic for c in reader.connections})) or "nothing"
            raise InputError(f"{path}: has no {', '.join(sorted(topics))}; it has {present}")
        for connection, stamp, data in reader.messages(chosen):
            yield Message(connection.topic, connection.msgtype, stamp, bytes(data), _was_latched(connection))


def _was_latched(connection: Connection) -> bool:
    profiles = connection.ext.offered_qos_profiles
    return bool(profiles) and all(q.durability is QosDurability.TRANSIENT_LOCAL for q in profiles)


@contextlib.contextmanager
def readable(path: Path) -> Iterator[None]:
    """Any failure of the reading libraries on a bag's bytes as an InputError."""
    if not is_bag(path):
        raise InputError(f"{path}: not a bag; give an .mcap file or a folder with metadata.yaml")
    try:
        yield
    except InputError:
        raise
    except Exception as error:
        raise InputError(
            f"{path}: cannot be read as a bag ({error}); record it again or try 'ros2 bag reindex'"
        ) from error


class _Track:
    """The stamps of one frame's transforms in order of recording.

    Late ones are put where their stamp says, but for those that are later than `_LATEST_NS`. The frame's time runs
    backwards where it goes over more than that again, as in a looped bag. Attributes: late and left_out, how many;
    jump, the stamp [ns] where time first ran backwards.
    """

    def __init__(self) -> None:
        self.late = self.left_out = 0
        self.jump: int | None = None
        self._newest = self._again_from = -math.inf

    def too_late(self, stamp: int) -> bool:
        return stamp < self._newest - _LATEST_NS

    def add(self, stamp: int, is_used: bool) -> None:
        """The next transform that is one."""
        self.left_out += not is_used
        if stamp > self._newest:
            self._newest, self._again_from = stamp, math.inf
            return
        self.late += is_used
        self._again_from = min(stamp, self._again_from)
        if self.jump is None and stamp - self._again_from > _LATEST_NS:
            self.jump = self._again_from


def _all_transforms(path: Path, asked: Iterable[tuple[str, str]]) -> tuple[TransformBuffer, str]:
    """Every transform of a bag, and why one was refused, the last such reason; empty if none was.

    asked: pairs of frames, on the way between which no time may run backwards, and what is late or repeated is told on
    stderr. Other frames may have odd clocks.
    """
    buffer, refused = TransformBuffer(history_s=_FOREVER_S, jump_s=_FOREVER_S), ""
    unused = TransformBuffer()
    parents: dict[str, str] = {}
    tracks: dict[str, _Track] = {}
    store = typestore()
    for message in bag_messages(path, {TF_TOPIC, TF_STATIC_TOPIC}):
        with readable(path):
            content = store.deserialize_cdr(message.data, message.type_name)
        static = message.topic == TF_STATIC_TOPIC
        for item in content.transforms:
            stamp = stamp_ns(item.header.stamp)
            parent, child = item.header.frame_id.lstrip("/"), item.child_frame_id.lstrip("/")
            track = tracks.setdefault(child, _Track())
            target = unused if not static and track.too_late(stamp) else buffer
            try:
                outcome = target.insert(parent, child, stamp, xyzquat_from_msg(item.transform), static)
            except TransformError as error:
                refused = str(error)
                continue
            parents[child] = parent
            if not static:
                track.add(stamp, target is buffer and outcome is not Insertion.DUPLICATE)
    for target, source in asked:
        for child in sorted(tracks.keys() & _between(target, source, parents)):
            _report(path, child, tracks[child])
    return buffer, refused


def _report(path: Path, frame: str, track: _Track) -> None:
    """Raise InputError if a frame's time runs backwards; else tell how many of its transforms are late."""
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


def _between(target: str, source: str, parents: Mapping[str, str]) -> set[str]:
    """The frames whose transforms lie on the way from one frame to the other."""
    return set(ancestors(target, parents.get)) ^ set(ancestors(source, parents.get))


def _true_pose(transforms: TransformBuffer, stamp: int) -> np.ndarray | None:
    try:
        return transforms.lookup(TRUTH_FRAME, TRUTH_GEL_FRAME, stamp)
    except TransformError:
        return None


def decode_image(message: Message, path: Path) -> np.ndarray:
    """Pixels (320, 240, 3) uint8 RGB of an Image (rgb8, bgr8) or a CompressedImage from the bag at `path`.

    Raises InputError if it holds no such image.
    """
    with readable(path):
        content = typestore().deserialize_cdr(message.data, message.type_name)
    what = f"{path}: image on {message.topic} at {message.stamp_ns / 1e9:.3f} s"
    if message.type_name not in (IMAGE_TYPE, COMPRESSED_TYPE):
        raise InputError(f"{what} is {message.type_name}; record images")
    try:
        return _rgb(content, 320, 240) if message.type_name == COMPRESSED_TYPE else rgb_from_msg(content, 320, 240)
    except InputError as error:
        raise InputError(f"{what}: {error}; record it again") from error


def _rgb(compressed: object, height: int, width: int) -> np.ndarray:
    pixels = cv2.imdecode(np.asarray(compressed.data), cv2.IMREAD_COLOR_RGB)
    if pixels is None:
        raise InputError("it cannot be decompressed")
    if pixels.shape != (height, width, 3):
        raise InputError(f"image is {pixels.shape[1]} x {pixels.shape[0]} pixels, expected {width} x {height}")
    return pixels
