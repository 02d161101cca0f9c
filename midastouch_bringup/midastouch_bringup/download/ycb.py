"""Meshes of the YCB Object and Model Set (Calli et al., 2015; CC BY 4.0), from its own server."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from pathlib import Path

from midastouch_perception.errors import InputError
from midastouch_perception.files import atomic_path, sha256

from .archive import content, opened
from .checksums import check_or_record, recorded
from .transfer import fetch

SERVER = "https://ycb-benchmarks.s3.amazonaws.com/data"
_MEMBER = "nontextured.ply"


def download_mesh(name: str, folder: Path, server: str = SERVER, progress: Callable = lambda done, total: None) -> Path:
    """The 16k-face scan of an object such as 025_mug as `folder/NAME.ply`, metres; returns that path.

    A mesh that is there already, unchanged, is not fetched again; an archive must have the SHA-256 of the first
    download into this folder. Raises InputError: no such
    object, see `fetch`, see `opened`.
    """
    if not re.fullmatch(r"\d{3}(-[a-z])?_[a-z0-9_]+", name):
        raise InputError(f"{name}: not the name of a YCB object; they look like 025_mug or 065-a_cups")
    archive = f"{name}_google_16k.tgz"
    packed, mesh = folder / archive, folder / f"{name}.ply"
    known = recorded(folder)
    if mesh.is_file() and sha256(mesh) == known.get(mesh.name):
        return mesh
    fetch(f"{server}/google/{archive}", packed, known.get(archive), progress=progress)
    with opened(packed) as (members, source):
        found = [member for member in members if member.path.parts[-2:] == ("google_16k", _MEMBER)]
        if not found:
            raise InputError(f"{packed}: holds no google_16k/{_MEMBER}; has its layout changed?")
        with atomic_path(mesh) as temporary, content(source, found[0]) as stream, temporary.open("wb") as out:
            shutil.copyfileobj(stream, out)
    check_or_record(folder, archive, packed)
    check_or_record(folder, mesh.name, mesh)
    packed.unlink()
    return mesh
