"""The sensor's fixed frames, as `config/frames.yaml` defines them."""

from __future__ import annotations

import os

import numpy as np
from scipy.spatial.transform import Rotation

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.files import read_yaml

_ENTRIES = ("hand_eye", "gel", "optical")


def read_mount(
    path: str | os.PathLike, sensor_prefix: str = "", tool_frame: str = "", tf_prefix: str = ""
) -> list[tuple[str, str, np.ndarray]]:
    """Read a frames file.

    Parameters
    ----------
    path
    sensor_prefix
        Put before the sensor's frames.
    tool_frame
        If given, replaces the frame that the sensor is mounted on.
    tf_prefix
        Put before the arm's frames.

    Returns
    -------
    list of (parent, child, `T_parent_child` (4, 4))

    Raises
    ------
    InputError
        The file is no valid frames file; the message names file and entry.
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
