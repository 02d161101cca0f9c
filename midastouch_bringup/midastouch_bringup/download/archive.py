"""Zip archives of strangers: only plain files, only below the folder they are unpacked into."""

from __future__ import annotations

import shutil
import stat
import zipfile
import zlib
from pathlib import Path, PurePosixPath

from midastouch_common.errors import InputError
from midastouch_common.files import atomic_path

RESERVE = 32 << 20


def extract(path: Path, folder: Path) -> int:
    """Unpack all of an archive into `folder`, which appears when all is there; returns the number of files.

    Raises InputError: not an archive, damaged, larger than the disk, or one member is an absolute path, leaves the
    folder, is a link or there twice. One such member condemns the archive: it was made to do harm.
    """
    try:
        with zipfile.ZipFile(path) as archive, atomic_path(folder) as temporary:
            members = [info for info in archive.infolist() if not info.is_dir()]
            _check(path, members)
            wanted, free = sum(info.file_size for info in members), shutil.disk_usage(temporary.parent).free
            if wanted + RESERVE > free:
                raise InputError(f"{path}: unpacks to {wanted >> 20} MiB, but {free >> 20} MiB are free; make room")
            temporary.mkdir()
            for info in members:
                archive.extract(info, temporary)
            return len(members)
    except (zipfile.BadZipFile, zlib.error, EOFError) as error:
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
