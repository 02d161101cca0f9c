"""The sensor's fixed frames, as `config/frames.yaml` has them."""

from __future__ import annotations

import os

import numpy as np
import yaml
from scipy.spatial.transform import Rotation

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.files import atomic_path, read_yaml

_ENTRIES = ("hand_eye", "gel", "optical")


def read_mount(
    path: str | os.PathLike, sensor_prefix: str = "", tool_frame: str = "", tf_prefix: str = ""
) -> list[tuple[str, str, np.ndarray]]:
    """(parent, child, T_parent_child (4, 4)) of every entry of a frames file.

    sensor_prefix is put before the sensor's frames, tf_prefix before the arm's; tool_frame replaces the frame that the
    sensor is mounted on. Raises InputError, naming file and entry, for a file that does not say where the sensor is.
    """
    entries = read_yaml(path, "frames")
    if not isinstance(entries, dict) or set(entries) != set(_ENTRIES):
        raise InputError(f"{path}: must hold {', '.join(_ENTRIES)} and nothing else; see config/frames.yaml")
    mount = []
    for name in _ENTRIES:
        entry = entries[name]
        try:
            parent, child = str(entry["parent"]), str(entry["child"])
            xyz, rpy = (np.array(entry[key], float) for key in ("xyz", "rpy"))
            if xyz.shape != (3,) or rpy.shape != (3,) or not np.isfinite([xyz, rpy]).all():
                raise ValueError("xyz and rpy are three finite numbers each")
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"{path}: {name}: {error}; wanted are parent, child, xyz (m) and rpy (rad)") from error
        parent = tf_prefix + (tool_frame or parent) if name == "hand_eye" else sensor_prefix + parent
        # "xyz" in lower case: about the fixed axes, as in URDF
        mount.append((parent, sensor_prefix + child, se3.make(Rotation.from_euler("xyz", rpy).as_matrix(), xyz)))
    return mount


def correct_mount(frames: str | os.PathLike, out: str | os.PathLike, T_nominal_true: np.ndarray) -> np.ndarray:
    """Write a copy of a frames file whose `hand_eye` puts the gel where it really is; returns that entry's change.

    T_nominal_true (4, 4): the true gel frame in the one that `frames` has. The change (4, 4) is in the
    housing's frame. Raises InputError as `read_mount`.
    """
    (_, _, T_tool_link), (_, _, T_link_gel), _ = read_mount(frames)
    change = T_link_gel @ T_nominal_true @ se3.inverse(T_link_gel)
    corrected = T_tool_link @ change
    entries = read_yaml(frames, "frames")
    entries["hand_eye"]["xyz"] = corrected[:3, 3].round(6).tolist()
    entries["hand_eye"]["rpy"] = Rotation.from_matrix(corrected[:3, :3]).as_euler("xyz").round(6).tolist()
    with atomic_path(out) as temporary:
        temporary.write_text(yaml.safe_dump(entries, sort_keys=False))
    return change
