"""Symmetries that a user gives, in the format of the BOP benchmark's `models_info.json`.

`symmetries_discrete` lists 4x4 matrices row by row, `symmetries_continuous` axes with an offset; lengths are in mm.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from midastouch_common.errors import InputError
from midastouch_common.files import require_file

from .group import Symmetry

_MOTION_TOLERANCE = 1e-3
_MM = 1e-3


def symmetry_of_bop(file: str) -> Symmetry:
    """Read the symmetry of one object from a `models_info.json`.

    file: the path; if the file describes several objects, followed by the object's key, e.g. `:5`.
    Raises InputError: no such file, not of this format, no such object, a matrix that is not a rigid motion, several
    axes that do not meet in a point.
    """
    name = None
    if not Path(file).is_file() and ":" in file:
        file, name = file.rsplit(":", 1)
    path = require_file(file, "symmetries")
    try:
        objects = json.loads(path.read_text())
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(f"{path}: not a JSON file ({error}); write it as BOP's models_info.json") from error
    if not isinstance(objects, dict) or not all(isinstance(each, dict) for each in objects.values()):
        raise InputError(f"{path}: not a table of objects; write it as BOP's models_info.json")
    if name is None and len(objects) != 1:
        raise InputError(f"{path}: describes {len(objects)} objects; say which one: {path}:ID")
    if name is not None and name not in objects:
        raise InputError(f"{path}: no object {name}; there are {', '.join(objects)}")
    info = objects[name] if name is not None else next(iter(objects.values()))
    try:
        discrete = np.array(info.get("symmetries_discrete", []), float).reshape(-1, 4, 4)
        continuous = [
            (np.array(each["axis"], float).reshape(3), _MM * np.array(each["offset"], float).reshape(3))
            for each in info.get("symmetries_continuous", [])
        ]
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(
            f"{path}: {error} in symmetries_discrete (16 numbers each) or symmetries_continuous (axis, offset)"
        ) from error
    discrete[:, :3, 3] *= _MM
    return _group(path, _checked(path, discrete), continuous)


def _checked(path: Path, motions: np.ndarray) -> np.ndarray:
    rotations = motions[:, :3, :3]
    orthonormal = np.abs(rotations @ rotations.swapaxes(1, 2) - np.eye(3)).max(initial=0.0) < _MOTION_TOLERANCE
    row_major = (motions[:, 3] == [0, 0, 0, 1]).all()
    if not (np.isfinite(motions).all() and row_major and orthonormal and (np.linalg.det(rotations) > 0).all()):
        raise InputError(
            f"{path}: a matrix in symmetries_discrete is not a rigid motion, row by row, the last row 0 0 0 1 (nor "
            "may it mirror)"
        )
    return motions


def _group(path: Path, discrete: np.ndarray, continuous: list[tuple[np.ndarray, np.ndarray]]) -> Symmetry:
    transforms = np.concatenate([np.eye(4)[None], discrete])
    if not continuous:
        return Symmetry(transforms)
    axes, offsets = (np.array(each) for each in zip(*continuous, strict=True))
    lengths = np.linalg.norm(axes, axis=1, keepdims=True)
    if not (np.isfinite(offsets).all() and np.isfinite(axes).all() and (lengths > 0).all()):
        raise InputError(f"{path}: an axis in symmetries_continuous has no direction or is not finite")
    axes = axes / lengths
    if (np.abs(axes @ axes[0]) > 1 - _MOTION_TOLERANCE).all():
        # all turns about the axis are free, so of the discrete motions only one that turns it over is needed
        flips = [motion for motion in discrete if motion[:3, :3] @ axes[0] @ axes[0] < 0]
        return Symmetry(np.array([np.eye(4), *flips[:1]]), "axis", axes[0], offsets[0])
    # turns about two axes that meet generate all turns about their common point
    across = np.eye(3) - axes[:, :, None] * axes[:, None]
    centre = np.linalg.lstsq(across.reshape(-1, 3), np.einsum("nij,nj->ni", across, offsets).ravel(), rcond=None)[0]
    if np.abs(np.einsum("nij,nj->ni", across, centre - offsets)).max() > _MM:
        raise InputError(f"{path}: the axes in symmetries_continuous do not meet; no object is symmetric so")
    return Symmetry(free="all", centre=centre)
