"""Reading of rosbag2 files: metadata, topics, and messages as they were recorded."""

from __future__ import annotations

import contextlib
import functools
import os
import struct
import sys
import zlib
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any, BinaryIO

import mcap.reader
import yaml
from rosbags.interfaces import Connection, QosDurability
from rosbags.rosbag2 import Reader

from midastouch_common import files
from midastouch_common.errors import InputError

from ..datasets.loading import is_bag, is_sequence, no_whole_bag
from ..text_table import counted
from .messages import TF_STATIC_TOPIC, Message, Topic
from .unfinished import UnfinishedBag, begins_as_mcap, is_unfinished

_FOOTER = struct.Struct("<9xQQI8x")  # starts of the summary and of its offsets, checksum
BEHIND_SUMMARY = 12
"""Bytes behind the summary of an MCAP file: its checksum and the end of the file."""


def bag_metadata(path: str | Path) -> dict[str, str]:
    """The custom data of a bag, such as `object` and `sequence`; empty for a bag that has none."""
    path = Path(path)
    with readable(path):
        if path.is_dir():
            return _information(path).get("custom_data") or {}
        if is_unfinished(path):  # they are written at the end
            return {}
        with path.open("rb") as stream:
            for record in mcap.reader.make_reader(stream).iter_metadata():
                if record.name == "rosbag2":
                    return yaml.safe_load(record.metadata["serialized_metadata"]).get("custom_data") or {}
    return {}


def bag_topics(path: str | Path) -> list[Topic]:
    """The topics of a bag that have messages. Raises InputError if it cannot be read."""
    return [topic for topic, count in message_counts(path).items() if count]


def message_counts(path: str | Path) -> dict[Topic, int]:
    """The number of messages on each topic of a bag, also on topics that have none. Raises InputError as above."""
    path, counts = Path(path), dict[Topic, int]()
    with _opened(path) as reader:
        for connection in reader.connections:
            topic = Topic(connection.topic, connection.msgtype, _was_latched(connection))
            counts[topic] = counts.get(topic, 0) + connection.msgcount
    return counts


def bag_duration(path: str | Path) -> float:
    """Seconds from the first message of a bag to the last. Raises InputError if it cannot be read."""
    path = Path(path)
    with _opened(path) as reader:
        return reader.duration / 1e9 if reader.message_count else 0.0


def bag_messages(path: str | Path, topics: Collection[str] = ()) -> Iterator[Message]:
    """Yield the messages of a bag in recorded order.

    Parameters
    ----------
    path
    topics
        Names of topics; all if none is named.

    Raises
    ------
    InputError
        The bag cannot be read, has none of the topics, or lists messages that its files lack.
    """
    path, found = Path(path), False
    with _opened(path) as reader:
        chosen = [c for c in reader.connections if not topics or c.topic in topics]
        if not chosen:
            present = ", ".join(sorted({c.topic for c in reader.connections})) or "nothing"
            raise InputError(f"{path}: has no {', '.join(sorted(topics))}; it has {present}")
        for connection, stamp, data in reader.messages(chosen):
            found = True
            yield Message(connection.topic, connection.msgtype, stamp, bytes(data), _was_latched(connection))
        if not found and (listed := sum(connection.msgcount for connection in chosen)):
            # rosbags passes over topics whose type or QoS differs between the list and the files
            names = ", ".join(sorted({connection.topic for connection in chosen}))
            raise InputError(
                f"{path}: lists {listed} messages on {names}, but its files hold none; write its list again: "
                f"ros2 bag reindex {path}"
            )


@contextlib.contextmanager
def _opened(path: Path) -> Iterator[Reader | UnfinishedBag]:
    with readable(path):
        if path.is_dir() and _information(path).get("compression_mode", "").lower() == "file":
            yield _unpacked(path, (path / "metadata.yaml").stat().st_mtime_ns)
            return
        if path.is_file() and is_unfinished(path):
            bag = UnfinishedBag(path)
            _warn(
                f"{path}: unfinished, as a recorder leaves it that is killed; "
                f"read {counted(bag.message_count, 'message')} of {bag.duration / 1e9:.1f} s"
            )
            yield bag
            return
        with Reader(path) as reader:
            for file in path.glob("*.mcap") if path.is_dir() else [path]:
                with file.open("rb") as stream:
                    found, noted = summary_checksums(stream)
                if noted and found != noted:
                    raise ValueError("its list of topics and messages is damaged")
            yield reader


def summary_checksums(stream: BinaryIO) -> tuple[int, int]:
    """Return the checksum of the summary of an MCAP file, and the one that its footer notes; both 0 without a summary.

    The reading libraries check those of the messages only.
    """
    stream.seek(-_FOOTER.size, os.SEEK_END)
    start, _, noted = _FOOTER.unpack(stream.read())
    if not start:
        return 0, 0
    stream.seek(start)
    return zlib.crc32(stream.read()[:-BEHIND_SUMMARY]), noted


@functools.cache
def _warn(line: str) -> None:
    """Print a line on stderr, once."""
    print(line, file=sys.stderr)


@functools.lru_cache(maxsize=1)
def _unpacked(path: Path, _changed_ns: int) -> Reader:
    """Open a bag of compressed files, and leave it open: rosbags decompresses all of them at every opening."""
    reader = Reader(path)
    reader.open()
    return reader


def _information(path: Path) -> dict[str, Any]:
    file = path / "metadata.yaml"
    fix = f"give the .mcap file inside, or write it again: ros2 bag reindex {path}"
    with files.readable(file, "not the metadata of a bag", fix):
        return dict(yaml.safe_load(file.read_text())["rosbag2_bagfile_information"])


def _was_latched(connection: Connection) -> bool:
    if connection.topic.endswith(TF_STATIC_TOPIC):  # whatever the recorder noted: it is sent once only
        return True
    profiles = connection.ext.offered_qos_profiles  # type: ignore[union-attr] # all are of ROS 2
    return bool(profiles) and all(q.durability is QosDurability.TRANSIENT_LOCAL for q in profiles)


def content_of(message: Message, path: Path) -> Any:
    """Return what a message of the bag at `path` says, as an object of the type store. Raises InputError if unread."""
    with readable(path):
        return message.content


@contextlib.contextmanager
def readable(path: Path) -> Iterator[None]:
    """Raise any failure of the reading libraries on a bag's bytes as an InputError."""
    if not is_bag(path):
        problem = no_whole_bag(path) if path.exists() else f"{path}: no such file or folder; check the path"
        if is_sequence(path):
            problem = f"{path}: a sequence, not a bag; midastouch evaluate reads it, midastouch to-bag converts it"
        raise InputError(problem or f"{path}: not a bag; give an .mcap file or a folder with metadata.yaml")
    try:
        yield
    except InputError:
        raise
    except Exception as error:
        if path.is_file() and not begins_as_mcap(path):
            raise InputError(f"{path}: not a bag; its content is not MCAP") from error
        said = f"{path}: cannot be read as a bag ({error})"
        if path.suffix == ".mcap" or any(path.glob("*.mcap")):
            what = path if path.is_file() else "each .mcap file in it"
            said += (
                f"; to save the rest, recover {what} with the program of https://mcap.dev/guides/cli: "
                "mcap recover IN.mcap -o OUT.mcap"
            )
        raise InputError(said) from error
