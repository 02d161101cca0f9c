"""Writing of rosbag2 files (MCAP).

A path that ends in `.mcap` is one file; any other is a rosbag2 folder with its `metadata.yaml`. `ros2 bag`
reads both.
"""

from __future__ import annotations

import contextlib
import shutil
import tempfile
from pathlib import Path

from rosbags.interfaces import Connection, Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

from midastouch_common.errors import InputError
from midastouch_common.files import naming

from ..datasets import Sequence
from .messages import Message, sequence_messages, typestore
from .reader import is_bag

_UNSET = QosTime(0, 0)


class BagWriter:
    """Writer of messages of any known type into a new bag: `with BagWriter(path) as bag: bag.write(message)`.

    The bag appears at `path`, replacing an older one, when the block ends well; if it fails, nothing is left.
    `metadata` are texts by name, kept in the bag's custom data. Raises InputError if `path` holds anything other than
    such a bag.
    """

    def __init__(self, path: str | Path, metadata: dict[str, str] | None = None) -> None:
        self._path = Path(path).expanduser()
        self._is_file = self._path.suffix == ".mcap"
        self._metadata = metadata or {}
        self._connections: dict[str, Connection] = {}
        if self._path.is_symlink():
            raise InputError(f"{self._path}: is a link; name the bag itself, or choose another name")
        if self._path.exists() and (not is_bag(self._path) or self._path.is_dir() == self._is_file):
            kind = "bag file" if self._is_file else "bag folder"
            raise InputError(f"{self._path}: exists and is no {kind}; choose another name")

    def __enter__(self) -> BagWriter:
        self._path.parent.mkdir(parents=True, exist_ok=True)
        with contextlib.ExitStack() as cleanup:
            try:
                temporary = tempfile.TemporaryDirectory(
                    prefix=f".{self._path.name}.", dir=self._path.parent, ignore_cleanup_errors=True
                )
            except OSError as error:  # which names the temporary folder
                raise OSError(error.errno, error.strerror, str(self._path)) from error
            folder = cleanup.enter_context(temporary)
            # the writer names the file inside after its folder, so the folder has the final name
            self._writer = Writer(Path(folder) / self._path.stem, version=9, storage_plugin=StoragePlugin.MCAP)
            self._writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
            for key, value in self._metadata.items():
                self._writer.set_custom_data(key, value)
            self._writer.open()
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
            with naming(self._path):
                self._writer.close()
            written = self._writer.path
            if self._is_file:
                (written / f"{written.name}.mcap").replace(self._path)
                return
            if self._path.exists():
                shutil.rmtree(self._path)
            written.replace(self._path)


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
