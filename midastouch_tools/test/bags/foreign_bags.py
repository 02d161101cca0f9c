"""Bags as others record them: of Humble, with other topics, sizes, QoS and compressions, in parts, cut off."""

from __future__ import annotations

import contextlib
import dataclasses
import sqlite3
from collections.abc import Callable, Iterable
from pathlib import Path

import cv2
import mcap.writer
import numpy as np
import yaml
from recorded import MOVED, SECOND, STILL, compressed, image, tf
from recorded import cut_off as halved
from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from sequences import smooth_image

from midastouch_tools.bags.messages import Message, typestore

N_IMAGES = 4
RAW = "/tactile/D20123/raw"
BEST_EFFORT = Qos(
    QosHistory.KEEP_LAST,
    5,
    QosReliability.BEST_EFFORT,
    QosDurability.VOLATILE,
    QosTime(0, 0),
    QosTime(0, 0),
    QosLiveliness.AUTOMATIC,
    QosTime(0, 0),
    False,
)
# as Humble writes it
_QOS_TEXT = (
    "- history: 3\n  depth: 0\n  reliability: 2\n  durability: 2\n  deadline: {sec: 9223372036, nsec: 854775807}\n"
    "  lifespan: {sec: 9223372036, nsec: 854775807}\n  liveliness: 1\n"
    "  liveliness_lease_duration: {sec: 9223372036, nsec: 854775807}\n  avoid_ros_namespace_conventions: false"
)


def recorded(edit: Callable[[Message], Message] = lambda message: message) -> list[Message]:
    """Messages of an arm with a sensor, each image between two transforms, each changed by `edit`."""
    messages = [tf(SECOND, STILL, "tool0", "digit_gel_frame", topic="/tf_static")]
    for i in range(N_IMAGES):
        stamp = SECOND + i * SECOND // 10
        messages.append(tf(stamp, MOVED if i % 2 else STILL, "base_link", "tool0"))
        messages.append(image(stamp, smooth_image(i)))
    return [edit(message) for message in messages]


def images_as(make: Callable[[Message, np.ndarray], Message]) -> list[Message]:
    """The same with other images: what `make` returns for a message and its RGB pixels."""
    pixels = map(smooth_image, range(N_IMAGES))
    return recorded(lambda message: make(message, next(pixels)) if message.topic == "/image_raw" else message)


def raw(topic: str, encoding: str = "rgb8", change: Callable[[np.ndarray], np.ndarray] = lambda pixels: pixels):
    """For `images_as`: raw images on a topic, of changed pixels."""

    def make(message: Message, pixels: np.ndarray) -> Message:
        return image(message.stamp_ns, np.ascontiguousarray(change(pixels)), encoding, topic=topic)

    return make


def landscape(pixels: np.ndarray) -> np.ndarray:
    """640 x 480 in the camera's own order, bgr8."""
    return cv2.resize(cv2.rotate(pixels, cv2.ROTATE_90_CLOCKWISE), (640, 480))[..., ::-1]


def small(topic: str):
    """For `images_as`: compressed images on a topic."""

    def make(message: Message, _: np.ndarray) -> Message:
        return dataclasses.replace(compressed(message), topic=topic)

    return make


def broken(message: Message, _: np.ndarray) -> Message:
    """For `images_as`: compressed images of which the second half was lost."""
    return halved(compressed(message, ".jpg"))


def write_bag(path: Path, messages: Iterable[Message], storage: StoragePlugin, mode: CompressionMode, qos=()) -> Path:
    """A bag by the writer of rosbags, which notes no QoS by itself."""
    writer = Writer(path, version=8, storage_plugin=storage)
    writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        connections = {}
        for message in messages:
            if message.topic not in connections:
                connections[message.topic] = writer.add_connection(
                    message.topic, message.type_name, typestore=typestore(), offered_qos_profiles=qos
                )
            writer.write(connections[message.topic], message.stamp_ns, message.data)
    return path


def plain(path: Path, messages: Iterable[Message] | None = None, qos=()) -> Path:
    """An uncompressed bag folder with an .mcap file."""
    return write_bag(path, messages or recorded(), StoragePlugin.MCAP, CompressionMode.NONE, qos)


def zstd_files(path: Path, storage: StoragePlugin = StoragePlugin.SQLITE3) -> Path:
    return write_bag(path, recorded(), storage, CompressionMode.FILE)


def zstd_messages(path: Path, storage: StoragePlugin = StoragePlugin.SQLITE3) -> Path:
    return write_bag(path, recorded(), storage, CompressionMode.MESSAGE)


def _edit_metadata(path: Path, edit: Callable[[dict], None]) -> Path:
    """Change the metadata of a bag folder; its path."""
    file = path / "metadata.yaml"
    content = yaml.safe_load(file.read_text())
    edit(content["rosbag2_bagfile_information"])
    file.write_text(yaml.safe_dump(content))
    return path


def of_humble(path: Path) -> Path:
    """Version 5: SQLite without definitions of types, QoS as a text."""
    write_bag(path, recorded(), StoragePlugin.SQLITE3, CompressionMode.NONE)
    with contextlib.closing(sqlite3.connect(path / f"{path.name}.db3")) as db, db:
        for table in ("schema", "metadata", "message_definitions"):
            db.execute(f"DROP TABLE {table}")
        db.execute("ALTER TABLE topics DROP COLUMN type_description_hash")
        db.execute("UPDATE topics SET offered_qos_profiles = ?", [_QOS_TEXT])

    def former(information: dict) -> None:
        information["version"] = 5
        del information["custom_data"], information["ros_distro"]
        for topic in information["topics_with_message_count"]:
            del topic["topic_metadata"]["type_description_hash"]
            topic["topic_metadata"]["offered_qos_profiles"] = _QOS_TEXT

    return _edit_metadata(path, former)


def split(path: Path) -> Path:
    """Two files, each with half of the messages."""
    next(plain(path).glob("*.mcap")).unlink()
    names = ["bag_0.mcap", "bag_1.mcap"]
    for name, part in zip(names, (slice(5), slice(5, None)), strict=True):
        half = plain(path.with_name(f"half_{name}"), recorded()[part])
        next(half.glob("*.mcap")).rename(path / name)

    def list_both(information: dict) -> None:
        information["relative_file_paths"] = names
        del information["files"]

    return _edit_metadata(path, list_both)


def without_index(path: Path) -> Path:
    """An .mcap file with neither chunks nor indexes nor statistics."""
    with path.open("wb") as stream:
        writer = mcap.writer.Writer(
            stream,
            index_types=mcap.writer.IndexType.NONE,
            use_chunking=False,
            use_statistics=False,
            use_summary_offsets=False,
            repeat_channels=False,
            repeat_schemas=False,
        )
        writer.start(profile="ros2")
        channels: dict[str, int] = {}
        for message in recorded():
            if message.topic not in channels:
                definition, _ = typestore().generate_msgdef(message.type_name, ros_version=2)
                schema = writer.register_schema(message.type_name, "ros2msg", definition.encode())
                channels[message.topic] = writer.register_channel(message.topic, "cdr", schema)
            writer.add_message(channels[message.topic], message.stamp_ns, message.data, message.stamp_ns)
        writer.finish()
    return path


def cut_off(path: Path) -> Path:
    """The first half of an .mcap file."""
    whole = without_index(path.with_name("whole.mcap")).read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    return path


def damaged(path: Path) -> Path:
    """An .mcap file with a gap."""
    whole = without_index(path).read_bytes()
    path.write_bytes(whole[: len(whole) // 2] + whole[2 * len(whole) // 3 :])
    return path


def without_metadata(path: Path) -> Path:
    """A folder that a killed recorder left."""
    (plain(path) / "metadata.yaml").unlink()
    return path


def part_of_one(path: Path) -> Path:
    """A single file of an SQLite bag."""
    folder = write_bag(path.with_suffix(""), recorded(), StoragePlugin.SQLITE3, CompressionMode.NONE)
    return next(folder.glob("*.db3")).rename(path)


def with_a_part_missing(path: Path) -> Path:
    (split(path) / "bag_1.mcap").unlink()
    return path


def listed_otherwise(path: Path) -> Path:
    """Metadata whose QoS is not that of the file."""

    def other_qos(information: dict) -> None:
        for topic in information["topics_with_message_count"]:
            topic["topic_metadata"]["offered_qos_profiles"] = _QOS_TEXT

    return _edit_metadata(plain(path), other_qos)
