"""MCAP files without their end, as a recorder leaves them that is killed."""

from __future__ import annotations

import contextlib
import struct
from collections import Counter
from collections.abc import Collection, Iterator
from io import SEEK_END, BytesIO
from pathlib import Path

from mcap.exceptions import EndOfFile
from mcap.records import Channel, McapRecord, Message, Schema
from mcap.stream_reader import StreamReader
from rosbags.interfaces import Connection, ConnectionExtRosbag2, MessageDefinition, MessageDefinitionFormat
from rosbags.rosbag2.metadata import parse_qos

_MAGIC, _DATA_END = b"\x89MCAP0\r\n", 0x0F
_NO_DEFINITION = MessageDefinition(MessageDefinitionFormat.NONE, "")


def begins_as_mcap(path: Path) -> bool:
    """Return whether a file begins as MCAP."""
    with path.open("rb") as stream:
        return stream.read(len(_MAGIC)) == _MAGIC


def is_unfinished(path: Path) -> bool:
    """Return whether a file begins as MCAP and does not end so."""
    with path.open("rb") as stream:
        begin, size = stream.read(len(_MAGIC)), stream.seek(0, SEEK_END)
        stream.seek(max(0, size - len(_MAGIC)))
        return begin == _MAGIC != stream.read()


class UnfinishedBag:
    """The messages up to the last whole record. It has what is used of the `Reader` of rosbags, which needs an end.

    Attributes: connections; message_count; duration [ns].
    """

    def __init__(self, path: Path):
        self._path = path
        schemas, channels, counts, stamps = {0: ""}, dict[int, Channel](), Counter[int](), list[int]()
        for record in self._records():
            if isinstance(record, Schema):
                schemas[record.id] = record.name
            elif isinstance(record, Channel):
                channels[record.id] = record
            elif isinstance(record, Message):
                counts[record.channel_id] += 1
                stamps = [min([record.log_time, *stamps]), max([record.log_time, *stamps])]
        self.connections = [
            Connection(
                each.id, each.topic, schemas[each.schema_id], _NO_DEFINITION, "", counts[each.id],
                ConnectionExtRosbag2(each.message_encoding, parse_qos(each.metadata.get("offered_qos_profiles", ""))),
                None,
            )
            for each in channels.values()
        ]  # fmt: skip
        self.message_count = sum(counts.values())
        self.duration = stamps[1] - stamps[0] + 1 if stamps else 0

    def messages(self, connections: Collection[Connection]) -> Iterator[tuple[Connection, int, bytes]]:
        """Yield connection, time of recording [ns] and content of each message of some connections."""
        chosen = {connection.id: connection for connection in connections}
        for record in self._records():
            if isinstance(record, Message) and record.channel_id in chosen:
                yield chosen[record.channel_id], record.log_time, record.data

    def _records(self) -> Iterator[McapRecord]:
        with self._path.open("rb") as stream:
            size = stream.seek(0, SEEK_END)
            stream.seek(len(_MAGIC))
            while len(head := stream.read(9)) == 9:
                kind, length = struct.unpack("<BQ", head)
                if kind in (0, _DATA_END) or stream.tell() + length > size:
                    return
                whole = BytesIO(head + stream.read(length))
                with contextlib.suppress(EndOfFile):
                    yield from StreamReader(whole, skip_magic=True, validate_crcs=True).records
