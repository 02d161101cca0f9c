"""Unpacking of untrusted archives: they may hold only plain files below the target folder."""

from __future__ import annotations

import contextlib
import errno
import shutil
import stat
import zipfile
from collections.abc import Iterator
from pathlib import Path, PurePosixPath

from midastouch_common.errors import InputError
from midastouch_common.files import atomic_path

RESERVE = 32 << 20
"""Bytes that stay free on the disk."""


def extract(path: Path, folder: Path) -> int:
    """Unpack an archive into `folder`, which appears once it is complete; returns the number of files.

    Raises InputError if it is no archive, damaged or too large for the disk, or if a member is an absolute path, leaves
    the folder, is a link or occurs twice. One such member is enough: the archive was made to do harm.
    """
    with readable_archive(path), zipfile.ZipFile(path) as archive, atomic_path(folder) as temporary:
        members = [info for info in archive.infolist() if not info.is_dir()]
        _check(path, members)
        wanted, free = sum(info.file_size for info in members), shutil.disk_usage(temporary.parent).free
        if wanted + RESERVE > free:
            raise InputError(f"{path}: unpacks to {wanted >> 20} MiB, but {free >> 20} MiB are free; make room")
        temporary.mkdir()
        for info in members:
            archive.extract(info, temporary)
        return len(members)


@contextlib.contextmanager
def readable_archive(path: Path) -> Iterator[None]:
    """Raise any failure to read an archive as an InputError. Errors of the disk pass."""
    try:
        yield
    except InputError:
        raise
    except Exception as error:  # the libraries raise a different type for each way a file can be broken
        if isinstance(error, OSError) and error.errno not in (None, errno.EINVAL):  # EINVAL: a wrong position in it
            raise
        raise InputError(f"{path}: not a readable archive ({error}); download it again") from error


def _check(archive: Path, members: list[zipfile.ZipInfo]) -> None:
    seen = set()
    for info in members:
        name = PurePosixPath(info.filename.replace("\\", "/"))
        if name.is_absolute() or ".." in name.parts or not name.parts or ":" in name.parts[0]:
            raise InputError(
                f"{archive}: refused, its member '{info.filename}' would leave the folder it is unpacked into"
            )
        if stat.S_IFMT(info.external_attr >> 16) not in (0, stat.S_IFREG):
            raise InputError(f"{archive}: refused, its member '{info.filename}' is a link or a device")
        if name in seen:
            raise InputError(f"{archive}: refused, its member '{info.filename}' is there twice")
        seen.add(name)
