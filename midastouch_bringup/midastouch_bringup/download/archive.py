"""Archives of strangers: only plain files, only below the folder they are unpacked into."""

from __future__ import annotations

import shutil
import stat
import tarfile
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import IO

from midastouch_perception.errors import InputError
from midastouch_perception.files import atomic_path

_RESERVE = 32 << 20


@dataclass(frozen=True)
class Member:
    """A plain file of an archive: its path inside, its size, and what the archive calls it."""

    path: PurePosixPath
    size: int
    handle: tarfile.TarInfo | zipfile.ZipInfo


@contextmanager
def opened(path: Path) -> Iterator[tuple[list[Member], tarfile.TarFile | zipfile.ZipFile]]:
    """The plain files of a tar (compressed or not) or zip archive, and the archive.

    Raises InputError: not an archive, damaged, or one member is an absolute path, leaves the folder, or is a link or
    device. One such member condemns the archive: it was made to do harm.
    """
    try:
        if zipfile.is_zipfile(path):
            with zipfile.ZipFile(path) as archive:
                yield [_checked(path, *_zip_entry(info)) for info in archive.infolist() if not info.is_dir()], archive
        else:
            with tarfile.open(path) as archive:
                yield [_checked(path, *_tar_entry(info)) for info in archive if not info.isdir()], archive
    except (tarfile.TarError, zipfile.BadZipFile, zlib.error, EOFError, OSError) as error:
        if isinstance(error, OSError) and error.errno is not None:
            raise  # the disk's problem, not the archive's
        raise InputError(f"{path}: not a readable archive ({error}); download it again") from error


def content(archive: tarfile.TarFile | zipfile.ZipFile, member: Member) -> IO[bytes]:
    """A file of an archive, to read."""
    return archive.open(member.handle) if isinstance(archive, zipfile.ZipFile) else archive.extractfile(member.handle)


def extract(path: Path, folder: Path) -> int:
    """Unpack all of an archive into `folder`, which appears when all is there; returns the number of files.

    Raises InputError as `opened`, and when the disk is too small.
    """
    with opened(path) as (members, archive), atomic_path(folder) as temporary:
        wanted, free = sum(member.size for member in members), shutil.disk_usage(temporary.parent).free
        if wanted + _RESERVE > free:
            raise InputError(f"{path}: unpacks to {wanted >> 20} MiB, but {free >> 20} MiB are free; make room")
        temporary.mkdir()
        for member in members:
            target = temporary / member.path
            target.parent.mkdir(parents=True, exist_ok=True)
            with content(archive, member) as source, target.open("xb") as out:
                shutil.copyfileobj(source, out)
        return len(members)


def _tar_entry(info: tarfile.TarInfo) -> tuple[str, int, bool, tarfile.TarInfo]:
    return info.name, info.size, info.isfile(), info


def _zip_entry(info: zipfile.ZipInfo) -> tuple[str, int, bool, zipfile.ZipInfo]:
    kind = stat.S_IFMT(info.external_attr >> 16)
    return info.filename, info.file_size, kind in (0, stat.S_IFREG), info


def _checked(archive: Path, name: str, size: int, plain: bool, handle) -> Member:
    path = PurePosixPath(name.replace("\\", "/"))
    if path.is_absolute() or ".." in path.parts or not path.parts or ":" in path.parts[0] or "\0" in name:
        raise InputError(f"{archive}: refused, its member '{name}' would leave the folder it is unpacked into")
    if not plain:
        raise InputError(f"{archive}: refused, its member '{name}' is a link or a device")
    return Member(path, size, handle)
