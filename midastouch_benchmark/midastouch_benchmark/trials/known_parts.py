"""Parts made by code, whose symmetry is known by construction: sets of them, and common symmetry groups."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from midastouch_common.mesh import ObjectMesh
from midastouch_perception.symmetry.group import Symmetry, about

_ORIGIN = np.zeros(3)


@dataclass(frozen=True)
class KnownPart:
    """Part of known symmetry. make: takes its name, returns its mesh; exact: all motions that map it onto itself; near:
    those after which most of it is the same (the exact ones among them), None if the exact ones are all."""

    make: Callable[[str], ObjectMesh]
    exact: Symmetry
    near: Symmetry | None = None


def write_parts(parts: Mapping[str, KnownPart], folder: Path) -> list[ObjectMesh]:
    """Write the meshes of all parts, by name, into the folder and return them."""
    meshes = []
    for name, part in parts.items():
        path = folder / f"{name}.ply"
        part.make(name).save(path)
        meshes.append(ObjectMesh.load(path))
    return meshes


NONE = Symmetry()
ROUND = Symmetry(free="axis")
ROUND_BOTH_WAYS = Symmetry(about(_ORIGIN, np.stack([np.eye(3), np.diag([1.0, -1, -1])])), "axis")
"""Symmetries of parts that are alike after any turn about z; the latter also after a half turn across z."""


def turns(count: int) -> Symmetry:
    """Return the turns about z by multiples of 1 / count of a circle."""
    return Symmetry(about(_ORIGIN, _about_z(count)))


def turns_and_flips(count: int) -> Symmetry:
    """Return the turns of `turns`, and half turns across z, the first of them about x."""
    rotations = _about_z(count)
    return Symmetry(about(_ORIGIN, np.concatenate([rotations, rotations @ np.diag([1.0, -1, -1])])))


def half_turn(axis: tuple[float, float, float]) -> Symmetry:
    """Return the half turn about an axis through the origin."""
    direction = np.array(axis) / np.linalg.norm(axis)
    return Symmetry(about(_ORIGIN, np.stack([np.eye(3), 2 * np.outer(direction, direction) - np.eye(3)])))


def _about_z(count: int) -> np.ndarray:
    angles = 2 * np.pi * np.arange(count) / count
    return Rotation.from_rotvec(angles[:, None] * [0.0, 0.0, 1.0]).as_matrix()
