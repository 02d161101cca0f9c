"""Meshes of the YCB Object and Model Set (Calli et al., 2015; CC BY 4.0), and YCB-Slide (Suresh et al., 2022).

The meshes come from their own server. YCB-Slide lies in shared folders of a drive that only the program `gdown` can
list; its recordings are CC BY-SA 4.0, and MIT is the licence of its code only (README of rpl-cmu/YCB-Slide).
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tarfile
from pathlib import Path

from midastouch_common.errors import InputError
from midastouch_common.files import atomic_path
from midastouch_common.missing_modules import pip_install

from .archive import extract, readable_archive
from .transfer import fetch

SERVER = "https://ycb-benchmarks.s3.amazonaws.com/data"
_MEMBER = "nontextured.ply"

_DRIVE = "https://drive.google.com/drive/folders/"
FOLDERS = {
    "sim": f"{_DRIVE}1a-8vfMCkW52BpWOPfqk5WM5zsSjBfhN1",
    "real": f"{_DRIVE}1VpMgRxrnerU9Dr6-qgLDPUf3lSrCR_yh",
    "backgrounds": f"{_DRIVE}1kYjONLAHRA_j4d2X0Enl-zHBIJFmG7Hc",
}
"""Parts of YCB-Slide, from the script in rpl-cmu/YCB-Slide."""


def download_mesh(name: str, folder: Path, server: str) -> Path:
    """Download the 16k-face scan of an object such as 025_mug to `folder/NAME.ply`, metres; returns that path.

    A mesh that is already there is not fetched again. Raises InputError as `fetch` does, for a name of no object, and
    for an archive that is damaged or holds no mesh.
    """
    if not re.fullmatch(r"\d{3}(-[a-z])?_[a-z0-9_]+", name):
        raise InputError(f"{name}: not the name of a YCB object; they look like 025_mug or 065-a_cups")
    archive, mesh = f"{name}_google_16k.tgz", folder / f"{name}.ply"
    if mesh.is_file():
        return mesh
    packed = folder / archive
    fetch(f"{server}/google/{archive}", packed)
    with atomic_path(mesh) as temporary:
        _take_mesh(packed, temporary)
    packed.unlink()
    return mesh


def _take_mesh(packed: Path, mesh: Path) -> None:
    """Copy the scan out of its archive. The other members, and the paths of all, are not used."""
    with readable_archive(packed), tarfile.open(packed) as archive:
        for member in archive:
            if member.isfile() and member.name.endswith(f"google_16k/{_MEMBER}"):
                with archive.extractfile(member) as stream, mesh.open("wb") as out:
                    shutil.copyfileobj(stream, out)
                return
    raise InputError(f"{packed}: holds no google_16k/{_MEMBER}; has its layout changed?")


def download_part(part: str, folder: Path, gdown: str | None = None) -> list[Path]:
    """Fetch a part of the dataset into `folder/PART` and unpack its archives; returns the folders unpacked.

    gdown: the program; None: the one next to this Python or on PATH. It continues what an earlier call has begun.
    Raises InputError if gdown is missing or fails, and as `extract` does.
    """
    program = gdown or shutil.which("gdown", path=str(Path(sys.executable).parent)) or shutil.which("gdown")
    if program is None:
        raise InputError(f"YCB-Slide lies on a shared drive that only gdown can list: {pip_install('gdown')}")
    target = folder / part  # gdown makes it
    command = [program, "--folder", FOLDERS[part], "--continue", "--output", str(target)]
    try:
        subprocess.run(command, check=True)
    except (OSError, subprocess.CalledProcessError) as error:
        raise InputError(f"{FOLDERS[part]}: gdown failed ({error}); call again to continue") from error
    unpacked = []
    for archive in sorted(target.glob("*.zip")):
        out = archive.with_suffix("")
        if not out.exists():
            extract(archive, out)
            unpacked.append(out)
        _lift(out)  # also what an earlier call extracted before it was killed
    return unpacked


def _lift(folder: Path) -> None:
    """Move `025_mug/025_mug/00` to `025_mug/00`: some archives hold the folder that they are named after."""
    inner = folder / folder.name
    if list(folder.iterdir()) == [inner] and inner.is_dir():
        moved = inner.rename(folder.with_name(f".{folder.name}.inner"))
        folder.rmdir()
        moved.rename(folder)
