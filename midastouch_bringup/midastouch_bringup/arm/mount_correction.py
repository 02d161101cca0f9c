"""What sliding has taught about the mount, put into a frames file."""

from __future__ import annotations

import os

import numpy as np
import yaml
from scipy.spatial.transform import Rotation

from midastouch_common import se3
from midastouch_common.files import atomic_path, read_yaml

from .mount_frames import read_mount


def correct_mount(frames: str | os.PathLike, out: str | os.PathLike, T_told_true: np.ndarray) -> np.ndarray:
    """Write a copy of a frames file whose `hand_eye` puts the gel where it really is; returns that entry's change.

    T_told_true (4, 4): the gel frame in the one that `frames` tells. The change (4, 4) is of the housing's frame, its
    own. Raises InputError as `read_mount`.
    """
    (_, _, T_tool_link), (_, _, T_link_gel), _ = read_mount(frames)
    change = T_link_gel @ T_told_true @ se3.inverse(T_link_gel)
    corrected = T_tool_link @ change
    entries = read_yaml(frames, "frames")
    entries["hand_eye"]["xyz"] = corrected[:3, 3].round(6).tolist()
    entries["hand_eye"]["rpy"] = Rotation.from_matrix(corrected[:3, :3]).as_euler("xyz").round(6).tolist()
    with atomic_path(out) as temporary:
        temporary.write_text(yaml.safe_dump(entries, sort_keys=False))
    return change
