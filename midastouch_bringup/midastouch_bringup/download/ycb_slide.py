"""YCB-Slide (Suresh et al., 2022): shared folders of a drive that only the program `gdown` can list.

The recordings are CC BY-SA 4.0; MIT is the licence of the code beside them (README of rpl-cmu/YCB-Slide).
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

from midastouch_common.errors import InputError

from .archive import extract
from .checksums import check_or_record

_DRIVE = "https://drive.google.com/drive/folders/"
FOLDERS = {
    "sim": f"{_DRIVE}1a-8vfMCkW52BpWOPfqk5WM5zsSjBfhN1",
    "real": f"{_DRIVE}1VpMgRxrnerU9Dr6-qgLDPUf3lSrCR_yh",
    "backgrounds": f"{_DRIVE}1kYjONLAHRA_j4d2X0Enl-zHBIJFmG7Hc",
}
"""Parts of the dataset, from the script in rpl-cmu/YCB-Slide."""


def download_part(part: str, folder: Path, gdown: str | None = None) -> list[Path]:
    """Fetch a part of the dataset into `folder/PART` and unpack its archives; returns the folders unpacked.

    gdown: the program; None: the one beside this Python or on PATH. It continues what an earlier call has begun. No
    checksums are published, so every archive must equal the first download. Raises InputError: no gdown, gdown
    fails, another archive than at first, see `extract`.
    """
    program = gdown or shutil.which("gdown", path=str(Path(sys.executable).parent)) or shutil.which("gdown")
    if program is None:
        raise InputError("YCB-Slide lies on a shared drive that only gdown can list: pip install gdown")
    target = folder / part
    target.mkdir(parents=True, exist_ok=True)
    command = [program, "--folder", FOLDERS[part], "--continue", "--output", str(target)]
    try:
        subprocess.run(command, check=True)
    except (OSError, subprocess.CalledProcessError) as error:
        raise InputError(f"{FOLDERS[part]}: gdown failed ({error}); call again to go on from there") from error
    unpacked = []
    for archive in sorted(target.glob("*.zip")):
        check_or_record(target, archive.name, archive)
        out = archive.with_suffix("")
        if not out.exists():
            extract(archive, out)
            _lift(out)
            unpacked.append(out)
    return unpacked


def _lift(folder: Path) -> None:
    """`025_mug/025_mug/00` -> `025_mug/00`: some archives hold the folder that they are named after."""
    inner = folder / folder.name
    if list(folder.iterdir()) == [inner] and inner.is_dir():
        moved = inner.rename(folder.with_name(f".{folder.name}.inner"))
        folder.rmdir()
        moved.rename(folder)
