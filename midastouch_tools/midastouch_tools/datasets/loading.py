"""Loading of a recording; the files in a folder identify its layout."""

from __future__ import annotations

from pathlib import Path

from midastouch_common.errors import InputError

from .sequence import Sequence
from .tactile_tracking import POSE_FILE, load_trial
from .ycb_slide import REAL_FILE, SIMULATED_FILE, load_real, load_simulated

_LOADERS = {SIMULATED_FILE: load_simulated, REAL_FILE: load_real, POSE_FILE: load_trial}


def is_sequence(path: str | Path) -> bool:
    """Return whether `path` is a folder with the file that identifies one of the layouts."""
    return any((Path(path) / file).is_file() for file in _LOADERS)


def load_sequence(path: str | Path) -> Sequence:
    """Return the sequence in folder `path`: a slide of YCB-Slide, simulated or real, or a trial of TactileTracking.

    Raises InputError if the folder is none of these, if files are missing, damaged or disagree in number, or if a
    pickle asks for foreign classes.
    """
    path = Path(path)
    if not path.is_dir():
        raise InputError(f"{path}: no such sequence folder; check the path")
    for file, load in _LOADERS.items():
        if (path / file).is_file():
            return load(path)
    if any(path.glob("*.mcap")) or any(path.glob("*.db3")):
        raise InputError(
            f"{path}: a bag without its metadata.yaml, as a recorder leaves it that was killed; write it anew, "
            "ros2 bag reindex, or give the .mcap file inside"
        )
    raise InputError(
        f"{path}: not a YCB-Slide sequence, nor a trial of TactileTracking (no {', '.join(_LOADERS)}); give the folder "
        "of a slide, such as sim/035_power_drill/00 or real/035_power_drill/dataset_0, or of a trial, such as avocado0"
    )
