"""Writing of rosbag2 files (MCAP).

A path that ends in `.mcap` is one file; any other is a rosbag2 folder with its `metadata.yaml`. `ros2 bag`
reads both.
"""

from __future__ import annotations

import contextlib
import os
import zlib
from pathlib import Path
from typing import Any

import mcap.reader
from rosbags.interfaces import Connection, Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

from midastouch_common.files import naming, require_new, temporary_beside

from ..datasets import Sequence
from .messages import Message, sequence_messages, typestore
from .reader import BEHIND_SUMMARY, summary_checksums

_UNSET = QosTime(0, 0)
_CHECKSUM = 9 + 24  # offset in a chunk's record, behind opcode, length, two times and a size


class BagWriter:
    """Writer of messages of any known type into a new bag: `with BagWriter(path) as bag: bag.write(message)`.

    The bag appears when the block ends well; if it fails, nothing is left. Attribute: metadata, which may be changed
    until then.

    Parameters
    ----------
    path
    metadata
        Texts by name, kept in the bag's custom data.

    Raises
    ------
    InputError
        Something is at the path.
    """

    def __init__(self, path: str | Path, metadata: dict[str, str] | None = None) -> None:
        self._path = Path(path).expanduser()
        self._is_file = self._path.suffix == ".mcap"
        self.metadata = dict(metadata or {})
        self._connections: dict[str, Connection] = {}
        require_new(self._path, "bag")

    def __enter__(self) -> BagWriter:
        with contextlib.ExitStack() as cleanup:
            folder = cleanup.enter_context(temporary_beside(self._path))
            try:
                folder.mkdir()
            except OSError as error:  # which names the temporary folder
                raise OSError(error.errno, error.strerror, str(self._path)) from error
            # the writer names the file inside after its folder, so the folder has the final name
            self._writer = Writer(folder / self._path.stem, version=9, storage_plugin=StoragePlugin.MCAP)
            self._writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
            self._writer.open()
            self._checksums = _noting_checksums(self._writer.storage)
            self._cleanup = cleanup.pop_all()
        return self

    def write(self, message: Message) -> None:
        """Append a message; its topic is added with its first message."""
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
                with contextlib.suppress(OSError):  # the disk may be gone; the first error is the one to report
                    self._writer.abort()
                return
            for key, value in self.metadata.items():
                self._writer.set_custom_data(key, value)
            with naming(self._path):
                self._writer.close()
            written = self._writer.path
            file = written / f"{written.name}.mcap"
            _write_checksums(file, self._checksums)
            if self._is_file:
                file.replace(self._path)
                return
            written.replace(self._path)


def _noting_checksums(storage: Any) -> list[int]:
    """Return a list of the checksums of the chunks that a storage of rosbags writes from now on: it writes none."""
    checksums: list[int] = []
    compress = storage.compressor

    def noted(chunk: bytes) -> bytes:
        checksums.append(zlib.crc32(chunk))
        return compress(chunk)

    storage.compressor = noted
    return checksums


def _write_checksums(file: Path, checksums: list[int]) -> None:
    with file.open("r+b") as stream:
        summary = mcap.reader.make_reader(stream).get_summary()
        for index, checksum in zip(summary.chunk_indexes, checksums, strict=True):
            stream.seek(index.chunk_start_offset + _CHECKSUM)
            stream.write(checksum.to_bytes(4, "little"))
        checksum = summary_checksums(stream)[0]
        stream.seek(-BEHIND_SUMMARY, os.SEEK_END)
        stream.write(checksum.to_bytes(4, "little"))


def _offered_qos(latched: bool) -> Qos:
    """Return the QoS of the recorded publisher, which `ros2 bag play` offers again."""
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
