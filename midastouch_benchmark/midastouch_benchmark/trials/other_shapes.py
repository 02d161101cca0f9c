"""Objects that differ a little from the mesh that the filter has of them, for protocol `other_shape`.

The pose stays that of the mesh's frame, so estimates are judged as usual.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np

from midastouch_common.mesh import ObjectMesh

from .cache import Cache

_SCALE = 1.03
_MISSING = 0.1  # of the surface
_DENT_DEPTH, _DENT_RADIUS = 3e-3, 15e-3  # m
_NOISE, _WAVELENGTHS = 5e-4, (8e-3, 25e-3)  # m: sigma along the normal, shortest and longest wave
_WAVES = 64
_EDGE = 2e-3  # m, longest edge of a surface that is bent


def scaled(mesh: ObjectMesh, rng: np.random.Generator) -> ObjectMesh:
    """Return the object 3 % larger or smaller, about the middle of its box."""
    middle = mesh.bounds.mean(axis=0)
    return _other(mesh, middle + (mesh.vertices - middle) * _SCALE ** rng.choice([-1.0, 1.0]))


def cut_off(mesh: ObjectMesh, rng: np.random.Generator) -> ObjectMesh:
    """Return the object without the tenth of its surface that sticks out most, such as a handle; it is flat there."""
    bent = mesh.refined(_EDGE)
    out = bent.vertices - mesh.bounds.mean(axis=0)
    farthest = out[np.linalg.norm(out, axis=1).argmax()]
    direction = farthest / np.linalg.norm(farthest)
    heights = out @ direction
    of_faces = heights[bent.faces].mean(axis=1)
    order = np.argsort(of_faces)
    beyond = np.cumsum(bent.face_areas[order]) > (1 - _MISSING) * bent.area
    return _other(bent, bent.vertices - np.maximum(heights - of_faces[order][beyond][0], 0.0)[:, None] * direction)


def dented(mesh: ObjectMesh, rng: np.random.Generator) -> ObjectMesh:
    """Return the object with a dent of 3 mm, 30 mm wide, somewhere."""
    bent = mesh.refined(_EDGE)
    points, normals, _ = mesh.sample_surface(1, rng)
    away = np.linalg.norm(bent.vertices - points[0], axis=1) / _DENT_RADIUS
    depth = _DENT_DEPTH * np.maximum(1 - away**2, 0.0) ** 2
    return _other(bent, bent.vertices - depth[:, None] * normals[0])


def noisy(mesh: ObjectMesh, rng: np.random.Generator) -> ObjectMesh:
    """Return the object with its surface off by 0.5 mm, sigma, in waves of 8 to 25 mm, like a scan."""
    bent = mesh.refined(_EDGE)
    directions = rng.standard_normal((3, _WAVES))
    waves = 2 * np.pi * directions / np.linalg.norm(directions, axis=0) / rng.uniform(*_WAVELENGTHS, _WAVES)
    height = np.cos(bent.vertices @ waves + rng.uniform(0, 2 * np.pi, _WAVES)).sum(axis=1) * np.sqrt(2 / _WAVES)
    return _other(bent, bent.vertices + _NOISE * height[:, None] * bent.vertex_normals)


DIFFERENCES: dict[str, Callable[[ObjectMesh, np.random.Generator], ObjectMesh]] = {
    "3 % larger or smaller": scaled,
    "a tenth of the surface, which sticks out farthest, is missing": cut_off,
    "a dent of 3 mm": dented,
    "the surface is off by 0.5 mm, in waves": noisy,
}
"""Differences by description; slides take them in turn."""


@dataclasses.dataclass(frozen=True)
class OtherShapeCache(Cache):
    """A cache whose slides are over objects that differ from the mesh asked for."""

    PREFIX = "other_shape_"

    def _simulate(self, mesh: ObjectMesh, number: int, path: Path) -> None:
        differ = list(DIFFERENCES.values())[number % len(DIFFERENCES)]
        super()._simulate(differ(mesh, np.random.default_rng(number)), number, path)


def _other(mesh: ObjectMesh, vertices: np.ndarray) -> ObjectMesh:
    return ObjectMesh(vertices, mesh.faces, mesh.name, mesh.sha256)
