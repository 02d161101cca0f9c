"""Is a mesh in the frame that a recording's poses are told in? A sensor that slides over it is near its surface."""

from __future__ import annotations

import numpy as np

from midastouch_bringup.datasets import Sequence
from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh

_NEAR, _FAR = 5e-3, 20e-3  # m: gel is pressed 2 mm deep, trackers are some millimetres off; no surface there
_FRAME = {"tactile_tracking": "the gel frame of the trial's first image"}


def mesh_doubt(sequence: Sequence, indices: list[int], mesh: ObjectMesh) -> str:
    """What to think of a mesh some millimetres off the true poses of these frames; empty if it is near.

    Raises InputError if it is so far off that the sensor cannot have touched it there.
    """
    _, distances, _ = mesh.closest_points(sequence.poses_true[indices][:, :3, 3])
    off = float(np.median(distances))
    if off <= _NEAR:
        return ""
    frame = _FRAME.get(sequence.layout, "the object's frame of the recording")
    said = f"{sequence.path}: the true poses are {1e3 * off:.0f} mm off the surface of {mesh.name} (median)"
    if off > _FAR:
        raise InputError(f"{said}, so it is not touched there; give the mesh in metres in {frame}")
    return f"{said}; is the mesh in {frame}?"
