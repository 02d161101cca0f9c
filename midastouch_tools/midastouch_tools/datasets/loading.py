"""Loading of a recording; the files in a folder identify its layout."""

from __future__ import annotations

from pathlib import Path

from midastouch_common.errors import InputError

from .sequence import Sequence
from .tactile_tracking import POSE_FILE, load_trial
from .ycb_slide import REAL_FILE, SIMULATED_FILE, load_real, load_simulated

_LOADERS = {SIMULATED_FILE: load_simulated, REAL_FILE: load_real, POSE_FILE: load_trial}


def is_bag(path: str | Path) -> bool:
    """Return whether `path` looks like a bag: an .mcap file, or a folder with `metadata.yaml`."""
    path = Path(path)
    return (path / "metadata.yaml").is_file() or (path.is_file() and path.suffix == ".mcap")


def is_sequence(path: str | Path) -> bool:
    """Return whether `path` is a folder with the file that identifies one of the layouts."""
    return any((Path(path) / file).is_file() for file in _LOADERS)


def no_whole_bag(path: Path) -> str:
    """Return why something of a bag at `path` cannot be read as one, with the fix; empty if it is nothing of a bag."""
    if path.is_dir():
        if not any(path.glob("*.mcap*")) and not any(path.glob("*.db3*")):
            return ""
        return (
            f"{path}: a bag without its metadata.yaml, as a recorder leaves it that was killed; call ros2 bag reindex "
            "to write it again, or give the .mcap file inside"
        )
    if path.suffix == ".bag":
        return f"{path}: a bag of ROS 1; convert it: rosbags-convert --src {path} --dst {path.with_suffix('')}"
    if path.name.endswith((".db3", ".db3.zstd", ".mcap.zstd")):
        return (
            f"{path}: a single file of a bag; give its folder, with metadata.yaml in it (ros2 bag reindex writes one)"
        )
    return ""


def load_sequence(path: str | Path) -> Sequence:
    """Load a slide of YCB-Slide, simulated or real, or a trial of TactileTracking. Images are read when asked for.

    Parameters
    ----------
    path
        Its folder.

    Raises
    ------
    InputError
        The folder is none of these, files are missing, damaged or disagree in number, or a pickle asks for foreign
        classes.
    """
    path = Path(path)
    if not path.exists():
        raise InputError(f"{path}: no such file or folder; check the path")
    for file, load in _LOADERS.items():
        if (path / file).is_file():
            return load(path)
    if is_bag(path):
        raise InputError(f"{path}: a bag, not a sequence; how to play it: midastouch inspect-bag {path}")
    if problem := no_whole_bag(path):
        raise InputError(problem)
    raise InputError(
        f"{path}: not a YCB-Slide sequence, nor a trial of TactileTracking (no {', '.join(_LOADERS)}); give the folder "
        "of a slide, such as sim/035_power_drill/00 or real/035_power_drill/dataset_0, or of a trial, such as avocado0"
    )
