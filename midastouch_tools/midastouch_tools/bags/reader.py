"""Reading of rosbag2 files: metadata, topics, and messages as they were recorded."""

from __future__ import annotations

import contextlib
from collections.abc import Collection, Iterator
from pathlib import Path

import mcap.reader
import yaml
from rosbags.interfaces import Connection, QosDurability
from rosbags.rosbag2 import Reader

from midastouch_common.errors import InputError

from .messages import TF_STATIC_TOPIC, Message, Topic


def is_bag(path: str | Path) -> bool:
    """Return whether `path` looks like a bag: an .mcap file, or a folder with `metadata.yaml`."""
    path = Path(path)
    return (path / "metadata.yaml").is_file() or (path.is_file() and path.suffix == ".mcap")


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


def bag_topics(path: str | Path) -> list[Topic]:
    """The topics of a bag that have messages. Raises InputError if it cannot be read."""
    path = Path(path)
    with readable(path), Reader(path) as reader:
        return [Topic(c.topic, c.msgtype, _was_latched(c)) for c in reader.connections if c.msgcount]


def bag_duration(path: str | Path) -> float:
    """Seconds from the first message of a bag to the last. Raises InputError if it cannot be read."""
    path = Path(path)
    with readable(path), Reader(path) as reader:
        return reader.duration / 1e9 if reader.message_count else 0.0


def bag_messages(path: str | Path, topics: Collection[str] = ()) -> Iterator[Message]:
    """Yield the messages of a bag on some topics (all if none is named) in recorded order.

    Raises InputError if the bag cannot be read or has none of the topics.
    """
    path = Path(path)
    with readable(path), Reader(path) as reader:
        chosen = [c for c in reader.connections if not topics or c.topic in topics]
        if not chosen:
            present = ", ".join(sorted({c.topic for c in reader.connections})) or "nothing"
            raise InputError(f"{path}: has no {', '.join(sorted(topics))}; it has {present}")
        for connection, stamp, data in reader.messages(chosen):
            yield Message(connection.topic, connection.msgtype, stamp, bytes(data), _was_latched(connection))


def _was_latched(connection: Connection) -> bool:
    if connection.topic.endswith(TF_STATIC_TOPIC):  # whatever the recorder noted: it is sent once only
        return True
    profiles = connection.ext.offered_qos_profiles  # type: ignore[union-attr] # all are of ROS 2
    return bool(profiles) and all(q.durability is QosDurability.TRANSIENT_LOCAL for q in profiles)


@contextlib.contextmanager
def readable(path: Path) -> Iterator[None]:
    """Raise any failure of the reading libraries on a bag's bytes as an InputError."""
    if not is_bag(path):
        raise InputError(f"{path}: not a bag; give an .mcap file or a folder with metadata.yaml")
    try:
        yield
    except InputError:
        raise
    except Exception as error:
        said = f"{path}: cannot be read as a bag ({error})"
        if path.suffix == ".mcap" or any(path.glob("*.mcap")):
            what = path if path.is_file() else "each .mcap file in it"
            said += (
                f"; if the recording was cut off, recover {what} with the program of https://mcap.dev/guides/cli: "
                "mcap recover IN.mcap -o OUT.mcap"
            )
        raise InputError(said) from error
