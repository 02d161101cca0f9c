"""Meshes of the YCB Object and Model Set (Calli et al., 2015; CC BY 4.0), from its own server."""

from __future__ import annotations

import gzip
import re
import shutil
import tarfile
import zlib
from collections.abc import Callable
from pathlib import Path

from midastouch_common.errors import InputError
from midastouch_common.files import atomic_path, sha256

from .checksums import check_or_record, recorded
from .transfer import fetch

SERVER = "https://ycb-benchmarks.s3.amazonaws.com/data"
_MEMBER = "nontextured.ply"


def download_mesh(name: str, folder: Path, server: str, progress: Callable = lambda done, total: None) -> Path:
    """The 16k-face scan of an object such as 025_mug as `folder/NAME.ply`, metres; returns that path.

    A mesh that is there already, unchanged, is not fetched again; an archive must have the SHA-256 of the first
    download into this folder. Raises InputError: no such object, see `fetch`, an archive that is damaged or holds
    no mesh.
    """
    if not re.fullmatch(r"\d{3}(-[a-z])?_[a-z0-9_]+", name):
        raise InputError(f"{name}: not the name of a YCB object; they look like 025_mug or 065-a_cups")
    archive = f"{name}_google_16k.tgz"
    packed, mesh = folder / archive, folder / f"{name}.ply"
    known = recorded(folder)
    if mesh.is_file() and sha256(mesh) == known.get(mesh.name):
        return mesh
    fetch(f"{server}/google/{archive}", packed, known.get(archive), progress=progress)
    with atomic_path(mesh) as temporary:
        _take_mesh(packed, temporary)
    check_or_record(folder, archive, packed)
    check_or_record(folder, mesh.name, mesh)
    packed.unlink()
    return mesh


def _take_mesh(packed: Path, mesh: Path) -> None:
    """Copy the scan out of its archive. The other members, and the paths of all, are not used."""
    try:
        with tarfile.open(packed) as archive:
            for member in archive:
                if member.isfile() and member.name.endswith(f"google_16k/{_MEMBER}"):
                    with archive.extractfile(member) as stream, mesh.open("wb") as out:
                        shutil.copyfileobj(stream, out)
                    return
    except (tarfile.TarError, zlib.error, EOFError, gzip.BadGzipFile) as error:
        raise InputError(f"{packed}: not a readable archive ({error}); download it again") from error
    raise InputError(f"{packed}: holds no google_16k/{_MEMBER}; has its layout changed?")
