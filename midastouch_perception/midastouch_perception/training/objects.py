"""The objects networks are trained on: YCB scans other than the paper's test objects, and procedural shapes."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh

from ..simulation.procedural import random_probe, random_shape

# the paper's ten test objects: never trained on
TEST_OBJECTS = ("004_", "005_", "006_", "021_", "025_", "035_", "037_", "042_", "048_", "055_")
# of the training scans, these measure generalisation while training
VALIDATION_OBJECTS = ("019_", "032_", "043_", "052_", "065-c_", "072-b_", "073-a_")
_STRETCH = 0.7, 1.4


def load_objects(folder: str | Path, procedural: int, seed: int) -> tuple[list[ObjectMesh], list[ObjectMesh]]:
    """Training and validation meshes: PLY files of `folder` without the test objects, and `procedural` random shapes.

    Raises InputError if the folder holds no usable mesh.
    """
    paths = [p for p in sorted(Path(folder).glob("*.ply")) if not p.name.startswith(TEST_OBJECTS)]
    if not paths:
        raise InputError(f"{folder}: no training meshes (*.ply) here; name the folder of the YCB scans")
    meshes = [ObjectMesh.load(path) for path in paths]
    held_out = [mesh for mesh in meshes if mesh.name.startswith(VALIDATION_OBJECTS)]
    rng = np.random.default_rng(seed)
    makers = (random_shape, random_shape, random_probe)
    shapes = [makers[i % 3](rng, f"procedural_{i}") for i in range(procedural)]
    return [mesh for mesh in meshes if mesh not in held_out] + shapes, held_out


def stretched(mesh: ObjectMesh, rng: np.random.Generator) -> ObjectMesh:
    """Another object: the mesh scaled by its own factor, 0.7 to 1.4, along each of three perpendicular directions."""
    axes = se3.exp(np.r_[np.zeros(3), rng.uniform(-np.pi, np.pi, 3)])[:3, :3]
    scale = axes * np.exp(rng.uniform(*np.log(_STRETCH), 3)) @ axes.T
    return ObjectMesh(mesh.vertices @ scale, mesh.faces, mesh.name, mesh.sha256)
