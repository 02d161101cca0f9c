"""Finds the symmetry of a mesh: rotations from a grid are aligned to the surface, and those that agree are kept."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from pykdtree.kdtree import KDTree
from scipy.spatial.transform import Rotation

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh

from .group import Symmetry

TOLERANCE = 1e-3  # m; scans of cans and boxes deviate from their own symmetry by about half of it
_SMALL, _SMALL_TOLERANCE = 0.04, 0.005  # m, and of the diagonal of what is smaller: a nut is no ring
_FRACTION = 0.9  # of the surface that must agree within the tolerance: prints, seams and scanning errors are not shape
_TURNS = 40  # by which a sphere is told
_FACING = np.cos(np.radians(45))  # a thin plate's other side is near, but not the same surface

_POINTS = 400  # for alignment and acceptance
_SAMPLES = 20_000  # that stand for the surface during alignment
_COARSE_POINTS = 60
_ROTATIONS = 6000  # start values over SO(3), about 14 deg apart
_APART = np.radians(20)  # start values that lie nearer to a better one are left out
_HOPELESS = 0.12  # mean distance over the radius beyond which no alignment is tried
_STARTS = 100
_ALIGNMENTS = 10
_SAME = np.radians(8)
_PROBES = np.sqrt([2, 3, 5, 7, 11, 13, 17])  # rad: angles that belong to no finite rotation group


def find_symmetry(mesh: ObjectMesh) -> Symmetry:
    """The symmetries of a mesh: motions after which 90 % of its surface lies within 1 mm of the surface (on small parts
    within half a percent of their diagonal) and faces the same way.

    Rotations from a grid over SO(3) are aligned to the surface (point to plane); those that then agree are kept.
    An axis about which every angle agrees, and a centre about which nearly every rotation does, are told by trying.
    """
    tolerance = TOLERANCE if mesh.diagonal > _SMALL else _SMALL_TOLERANCE * mesh.diagonal
    surface = _Surface(mesh, tolerance)
    centre = np.average(mesh.vertices[mesh.faces].mean(axis=1), axis=0, weights=mesh.face_areas)
    turned = _about(centre, Rotation.random(_TURNS, random_state=0).as_matrix())
    if np.mean([surface.deviation(motion) <= tolerance for motion in turned]) >= _FRACTION:  # a softball bulges here
        return Symmetry(free="all", centre=centre)
    found = [np.eye(4)]
    for start in surface.promising(_about(centre, _rotation_grid(_ROTATIONS))):
        aligned = surface.align(start)
        known = se3.inverse(np.array(found)) @ aligned
        if surface.deviation(aligned) <= tolerance and se3.rotation_angle(known[:, :3, :3]).min() > _SAME:
            found.append(aligned)
    return _axial(surface, found) or Symmetry(transforms=np.array(found), centre=centre)


def cached_symmetry(mesh: ObjectMesh, folder: str | os.PathLike) -> Symmetry:
    """The symmetry of a mesh from an earlier call, found and written into `folder` if there is none."""
    path = Path(folder) / f"{mesh.name}_{mesh.sha256[:12]}.json"
    try:
        return Symmetry.load(path)
    except InputError:
        symmetry = find_symmetry(mesh)
        symmetry.save(path)
        return symmetry


def _axial(surface: _Surface, found: list[np.ndarray]) -> Symmetry | None:
    """The symmetry about an axis through all of whose angles the surface agrees; None if there is none."""
    best, least = None, surface.tolerance
    for transform in found[1:]:
        turn = Rotation.from_matrix(transform[:3, :3]).as_rotvec()
        angle = np.linalg.norm(turn)
        if not np.radians(30) < angle < np.radians(170):  # else the axis is badly known, or that of a flip
            continue
        axis = turn / angle
        # the fixed points of the motion are a line along the axis: the one nearest to the origin
        offset = transform[:3, 3] - (transform[:3, 3] @ axis) * axis
        centre = np.linalg.lstsq(np.eye(3) - transform[:3, :3], offset, rcond=None)[0]
        probes = _about(centre, Rotation.from_rotvec(_PROBES[:, None] * axis).as_matrix())
        worst = max(surface.deviation(probe) for probe in probes)
        if worst <= least:
            best, least = (axis, centre), worst
    if best is None:
        return None
    axis, centre = best
    flips = [t for t in found if axis @ t[:3, :3] @ axis < 0]
    return Symmetry(np.array([np.eye(4), *flips[:1]]), "axis", axis, centre)


class _Surface:
    """How well a moved surface agrees with itself. `radius` [m]: mean distance of the surface to its middle."""

    def __init__(self, mesh: ObjectMesh, tolerance: float):
        self.tolerance = tolerance
        self._mesh = mesh
        rng = np.random.default_rng(0)
        self._points, self._normals, _ = mesh.sample_surface(_POINTS, rng)
        self._samples, self._sample_normals, _ = mesh.sample_surface(_SAMPLES, rng)
        self._tree = KDTree(self._samples)
        self._near = tolerance + 3 * np.sqrt(mesh.area / _SAMPLES)
        self.radius = float(np.linalg.norm(self._points - self._points.mean(axis=0), axis=1).mean())

    def deviation(self, transform: np.ndarray) -> float:
        """Distance [m] within which 90 % of the surface, moved by (4, 4), lies of the surface facing the same way."""
        points = self._points @ transform[:3, :3].T + transform[:3, 3]
        normals = self._normals @ transform[:3, :3].T
        distance = np.full(len(points), np.inf)
        near = np.flatnonzero(self._tree.query(points)[0] < self._near)
        if len(near) < _FRACTION * len(points):
            return np.inf
        _, distance[near], face = self._mesh.closest_points(points[near])
        facing = np.einsum("nj,nj->n", normals[near], self._mesh.face_normals[face])
        distance[near[facing < _FACING]] = np.inf
        return float(np.quantile(distance, _FRACTION, method="higher"))

    def promising(self, transforms: np.ndarray) -> list[np.ndarray]:
        """Those of motions (K, 4, 4) that agree best before alignment, well apart from one another and the identity."""
        points = self._points[:_COARSE_POINTS]
        moved = np.einsum("kij,nj->kni", transforms[:, :3, :3], points) + transforms[:, None, :3, 3]
        distance = self._tree.query(moved.reshape(-1, 3))[0].reshape(len(transforms), -1).mean(axis=1)
        rotations = transforms[:, :3, :3]
        left = np.argsort(distance, kind="stable")
        left = left[(distance[left] < _HOPELESS * self.radius) & (se3.rotation_angle(rotations[left]) > _APART)]
        chosen: list[np.ndarray] = []
        while len(left) and len(chosen) < _STARTS:
            chosen.append(transforms[left[0]])
            relative = np.swapaxes(rotations[left], -1, -2) @ chosen[-1][:3, :3]
            left = left[se3.rotation_angle(relative) > _APART]
        return chosen

    def align(self, transform: np.ndarray) -> np.ndarray:
        """The motion (4, 4) after point-to-plane alignment (Chen and Medioni 1992), far points counting less."""
        for _ in range(_ALIGNMENTS):
            points = self._points @ transform[:3, :3].T + transform[:3, 3]
            nearest = self._tree.query(points)[1]
            normals = self._sample_normals[nearest]
            facing = np.einsum("nj,nj->n", self._normals @ transform[:3, :3].T, normals) > _FACING
            if not facing.any():
                break
            residual = np.einsum("nj,nj->n", self._samples[nearest] - points, normals)
            scale = max(float(np.median(np.abs(residual[facing]))), self.tolerance / 2)
            weight = facing / (1.0 + (residual / scale) ** 2)
            middle = points.mean(axis=0)
            # turns as arcs at the object's radius, so that both halves of the step are in metres
            jacobian = np.concatenate([normals, np.cross((points - middle) / self.radius, normals)], axis=1)
            hessian = jacobian.T @ (weight[:, None] * jacobian)
            # directions that nothing constrains (about an axis of symmetry) stay as they are
            step = np.linalg.pinv(hessian, rcond=1e-3, hermitian=True) @ (jacobian.T @ (weight * residual))
            turn = Rotation.from_rotvec(step[3:] / self.radius).as_matrix()
            transform = se3.make(turn, middle + step[:3] - turn @ middle) @ transform
        return transform


def _about(centre: np.ndarray, rotations: np.ndarray) -> np.ndarray:
    """Motions (K, 4, 4) that turn about a point (3,)."""
    return se3.make(rotations, centre - rotations @ centre)


def _rotation_grid(n: int) -> np.ndarray:
    """n rotations (n, 3, 3) spread evenly over SO(3) (super-Fibonacci sampling, Alexa 2022)."""
    s = np.arange(n) + 0.5
    inner, outer = np.sqrt(s / n), np.sqrt(1 - s / n)
    alpha, beta = 2 * np.pi * s / np.sqrt(2), 2 * np.pi * s / 1.533751168755204
    rows = [inner * np.sin(alpha), inner * np.cos(alpha), outer * np.sin(beta), outer * np.cos(beta)]
    return Rotation.from_quat(np.stack(rows, axis=1)).as_matrix()
