"""Search for the symmetry of a mesh: rotations from a grid are aligned to the surface, and those that fit are kept."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product

import cv2
import numpy as np
from pykdtree.kdtree import KDTree
from scipy.spatial.transform import Rotation

from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh

from ..pointcloud import cloud_from_penetration
from ..rendering.renderer import PenetrationRenderer
from ..sensor_model import SensorModel
from .group import Symmetry, about

TOLERANCE = 1e-3  # m; scans of cans and boxes deviate from their own symmetry by about half of it
_SMALL, _SMALL_TOLERANCE = 0.04, 0.005  # m; fraction of the diagonal of smaller objects, so that a nut is no ring
_FRACTION = 0.85  # of the surface must fit within the tolerance; the rest may be prints, seams and scanning errors
_TURNS = 40  # random turns that recognise a sphere
_FACING = np.cos(np.radians(45))  # a thin plate's other side is near, but not the same surface

_POINTS = 400  # for alignment and acceptance
_SAMPLES = 20_000  # that represent the surface during alignment
_COARSE_POINTS = 60
_ROTATIONS = 6000  # start values over SO(3), about 14 deg apart
_APART = np.radians(20)  # start values that lie nearer to a better one are left out
_HOPELESS = 0.12  # mean distance over the radius beyond which no alignment is tried
_STARTS = 100
_ALIGNMENTS = 10
_SAME = np.radians(8)
_PROBED_TURNS = 11
_LARGEST_ORDER, _LARGEST_GROUP = 200, 400  # of a gear's turns; of motions
_SAME_ANGLE = np.radians(0.7)
_TURNS_ABOUT_AXIS, _SAME_DISTANCE = 12, 2e-3  # look-alikes about an axis; m, pose distance

_SEARCH = 2  # version; raise it when the search changes its results, so that older codebooks repeat it

DETECTABLE = 3e-4
"""m RMS over a patch: three standard deviations of a measured map (`FilterConfig.penetration_noise`). Less is hidden by
noise; the flats that approximate a round surface in a mesh make some 0.2 mm."""
_FLATS, _FEWEST_FLATS = 5e-4, 16
"""Largest deviation [m] and smallest number of the flats around an axis that count as a round surface."""
_PATCH = 4e-3  # m, over which that noise is fully correlated (`FilterConfig.penetration_correlation`)
_MOST_TOUCHES, _FIRST_PART, _PART = 2000, 50, 250
_FEW = 8  # every 8th touch judges products of motions that all touches judged; every 8th pixel gives a touched point
_MAP_SCALE = 0.5

_PROBES = np.sqrt([2, 3, 5, 7, 11, 13, 17])  # rad: angles that belong to no finite rotation group


@dataclass(frozen=True)
class ObjectSymmetry:
    """Symmetry of an object as far as it is known.

    exact: motions after which no touch differs by more than the noise of a map. residual: largest such difference [m].
    near: motions after which most of the surface is the same, including the exact ones. given: true if the user gave
    the exact ones.
    """

    exact: Symmetry = field(default_factory=Symmetry)
    residual: float = 0.0
    near: Symmetry = field(default_factory=Symmetry)
    given: bool = False

    @cached_property
    def look_alikes(self) -> np.ndarray:
        """Motions (K, 4, 4) that are nearly but not exactly symmetries, one of each coset of the exact group.

        From any pose they lead to poses that some touches can distinguish from it, but most cannot.
        """
        chosen: list[np.ndarray] = []
        for motion in self.near.turned(_TURNS_ABOUT_AXIS):
            known = np.array([np.eye(4), *chosen])
            if (self.exact.distance(known, motion) > _SAME_DISTANCE).all():
                chosen.append(motion)
        return np.array(chosen).reshape(-1, 4, 4)

    def describe(self) -> str:
        """Return a description for logs and tables."""
        exact = self.exact.describe()
        if not self.exact.trivial:
            exact += f" ({'given, ' * self.given}to {1e3 * self.residual:.2f} mm)"
        return f"{exact}; nearly: {len(self.look_alikes)} more" if len(self.look_alikes) else exact

    def as_json(self) -> dict:
        """Return the content that `from_json` reads."""
        return {
            "search": _SEARCH,
            "exact": self.exact.as_json(),
            "residual": self.residual,
            "near": self.near.as_json(),
            "given": self.given,
        }

    @classmethod
    def from_json(cls, content: dict) -> ObjectSymmetry | None:
        """Restore a symmetry from `as_json`; None if an earlier version of the search found it.

        Raises ValueError, KeyError or TypeError for any other content."""
        exact, near = (Symmetry.from_json(content[key]) for key in ("exact", "near"))
        known = cls(exact, float(content["residual"]), near, bool(content["given"]))
        return known if known.given or content.get("search") == _SEARCH else None


def object_symmetry(
    mesh: ObjectMesh,
    sensor: SensorModel,
    poses: np.ndarray,
    given: Symmetry | None = None,
    tried: Callable[[], object] = lambda: None,
) -> ObjectSymmetry:
    """Find the symmetry of a mesh, as a sensor measures it.

    Parameters
    ----------
    mesh
    sensor
    poses : gel poses `T_obj_gel` (N, 4, 4) all over the surface
    given
        The exact symmetry, if the user gives it; it is not checked.
    tried
        Called after each motion that was compared with the mesh or with its touches; their number is not known in
        advance.

    Returns
    -------
    ObjectSymmetry
        Motions that map the surface onto itself.
    """
    touches = _Touches(mesh, sensor, poses, tried)
    near, found = _near(mesh, touches.points(), tried)
    if given is not None:
        residual = max(touches.difference(motion, until=np.inf) for motion in given.turned(_PROBED_TURNS))
        return ObjectSymmetry(given, residual, near, given=True)
    exact, residual = _exact(touches, near, found)
    return ObjectSymmetry(exact, residual, near)


def _near(mesh: ObjectMesh, touched: np.ndarray, tried: Callable[[], object]) -> tuple[Symmetry, list[np.ndarray]]:
    """Return the motions after which most of the surface lies within 1 mm of the surface (on small parts within half a
    percent of their diagonal) and faces the same way, and the motions (4, 4) that led to them. Only the surface at the
    touched points (K, 3) counts.

    Rotations from a grid over SO(3) are aligned to the surface (point to plane); those that then fit are kept. Trials
    find out whether every angle about an axis fits, or nearly every rotation about the centre. tried: as in
    `object_symmetry`.
    """
    tolerance = TOLERANCE if mesh.diagonal > _SMALL else _SMALL_TOLERANCE * mesh.diagonal
    surface = _Surface(mesh, touched, tolerance, tried)
    centre = np.average(mesh.vertices[mesh.faces].mean(axis=1), axis=0, weights=mesh.face_areas)
    turned = about(centre, Rotation.random(_TURNS, random_state=0).as_matrix())
    if np.mean([surface.deviation(motion) <= tolerance for motion in turned]) >= _FRACTION:  # a softball bulges here
        return Symmetry(free="all", centre=centre), list(turned)
    found = [np.eye(4)]
    for start in surface.promising(about(centre, _rotation_grid(_ROTATIONS))):
        aligned = surface.align(start)
        if surface.deviation(aligned) <= tolerance and not _holds(found, aligned, _SAME):
            found.append(aligned)
    axial = _axial(surface, found)
    return axial or Symmetry(transforms=np.array(_completed(surface, found)), centre=centre), found


def _completed(surface: _Surface, found: list[np.ndarray]) -> list[np.ndarray]:
    """Return these motions (4, 4) and the products of two of them that also fit: the grid of rotations is coarser than
    the turns of a gear."""
    out = list(found)
    for first, second in product(found[1:], found[1:]):
        if len(out) >= _LARGEST_GROUP:
            break
        motion = first @ second
        if not _holds(out, motion, _SAME) and surface.deviation(aligned := surface.align(motion)) <= surface.tolerance:
            out.append(aligned)
    return out


def _exact(touches: _Touches, near: Symmetry, found: list[np.ndarray]) -> tuple[Symmetry, float]:
    """Return the largest group of near motions that no touch can detect, and its residual [m]."""
    most = DETECTABLE
    if near.free == "axis":
        # a gear's turns are finer than the grid of rotations
        order = _order(touches, near)
        found = [np.eye(4), about(near.centre, _turn(near.axis, order))[0], *found[1:]]
        most = _FLATS if order >= _FEWEST_FLATS else DETECTABLE
    if near.free != "none":
        probes = near.turned(_PROBED_TURNS) if near.free == "axis" else found[:_PROBED_TURNS]
        residual = max(touches.difference(motion, until=most) for motion in probes)
        if residual <= most:
            return near, residual
    generators: list[np.ndarray] = []
    group, residual = [np.eye(4)], 0.0
    for motion in found[1:]:
        if _holds(group, motion) or (difference := touches.difference(motion)) > DETECTABLE:
            continue
        larger, worst = _closed(touches, [*generators, motion])
        if worst <= DETECTABLE:
            generators, group, residual = [*generators, motion], larger, max(residual, difference, worst)
    return Symmetry(np.array(group), centre=near.centre), residual


def _order(touches: _Touches, near: Symmetry) -> int:
    """Return the largest n for which no touch can detect 1/n of a turn about the axis."""
    order = 1
    for prime in (n for n in range(2, _LARGEST_ORDER) if all(n % k for k in range(2, n))):
        while order * prime < _LARGEST_ORDER:
            (part,) = about(near.centre, _turn(near.axis, order * prime))
            if touches.difference(part) > DETECTABLE:
                break
            order *= prime
    return order


def _turn(axis: np.ndarray, order: int) -> np.ndarray:
    """Return the rotation (1, 3, 3) by 1/`order` of a turn about an axis (3,)."""
    return Rotation.from_rotvec(2 * np.pi / order * axis[None]).as_matrix()


def _holds(group: list[np.ndarray], motion: np.ndarray, same: float = _SAME_ANGLE) -> bool:
    """Return whether one of a group's motions (4, 4) has the same rotation as `motion`, to `same` [rad]."""
    between = np.swapaxes(np.array(group)[:, :3, :3], 1, 2) @ motion[:3, :3]
    return bool((se3.rotation_angle(between) < same).any())


def _closed(touches: _Touches, generators: list[np.ndarray]) -> tuple[list[np.ndarray], float]:
    """Return all products of the motions, and the largest difference [m] that one makes; if a limit on either is
    exceeded, an incomplete group and inf."""
    group, worst = [np.eye(4)], 0.0
    for motion in group:  # the list grows meanwhile
        for generator in generators:
            both = motion @ generator
            if not _holds(group, both):
                worst = max(worst, touches.difference(both, _FEW))
                if worst > DETECTABLE or len(group) >= _LARGEST_GROUP:
                    return group, np.inf
                group.append(both)
    return group, worst


class _Touches:
    """Maps that a gel measures all over the surface, at at most `_MOST_TOUCHES` of the poses."""

    def __init__(self, mesh: ObjectMesh, sensor: SensorModel, poses: np.ndarray, tried: Callable[[], object]):
        self._tried = tried
        self._poses = poses[:: -(-len(poses) // _MOST_TOUCHES)]
        self._renderer = PenetrationRenderer(mesh, sensor.scaled(_MAP_SCALE))
        self._maps = self._renderer.render(self._poses)
        pixel = np.sqrt(self._renderer.sensor.pixel_area)
        self._patch = max(round(_PATCH / pixel), 1)

    def points(self) -> np.ndarray:
        """Return points (K, 3) [m] that the gel touches: its middle at each pose, and one pixel in `_FEW` per side."""
        sensor, chosen = self._renderer.sensor, np.zeros(self._maps.shape[1:], bool)
        chosen[::_FEW, ::_FEW] = True
        clouds = [cloud_from_penetration(each, (each > 0) & chosen, sensor) for each in self._maps]
        moved = [cloud @ pose[:3, :3].T + pose[:3, 3] for cloud, pose in zip(clouds, self._poses, strict=True)]
        return np.concatenate([self._poses[:, :3, 3], *moved])

    def difference(self, motion: np.ndarray, stride: int = 1, until: float = DETECTABLE) -> float:
        """Return the largest RMS difference [m] over a patch of a map between gel poses and the same moved by a motion
        (4, 4), at every `stride`-th pose. Stops early once a difference is above `until`."""
        worst, asked = 0.0, np.arange(0, len(self._poses), stride)
        for part in np.split(asked, range(_FIRST_PART, len(asked), _PART)):
            squared = np.square(self._renderer.render(motion @ self._poses[part]) - self._maps[part])
            changed = squared.reshape(len(squared), -1).max(axis=1) > DETECTABLE**2
            for each in squared[changed]:
                worst = max(worst, float(cv2.blur(each, (self._patch, self._patch)).max()))
            if worst > until**2:
                break
        self._tried()
        return float(np.sqrt(worst))


def _axial(surface: _Surface, found: list[np.ndarray]) -> Symmetry | None:
    """Return the symmetry about an axis if the surface fits at every angle about one; otherwise None."""
    best, least = None, surface.tolerance
    for transform in found[1:]:
        turn = Rotation.from_matrix(transform[:3, :3]).as_rotvec()
        angle = np.linalg.norm(turn)
        if not np.radians(30) < angle < np.radians(170):  # the axis is inaccurate, or that of a flip
            continue
        axis = turn / angle
        # the fixed points of the motion are a line along the axis: the one nearest to the origin
        offset = transform[:3, 3] - (transform[:3, 3] @ axis) * axis
        centre = np.linalg.lstsq(np.eye(3) - transform[:3, :3], offset, rcond=None)[0]
        probes = about(centre, Rotation.from_rotvec(_PROBES[:, None] * axis).as_matrix())
        worst = max(surface.deviation(probe) for probe in probes)
        if worst <= least:
            best, least = (axis, centre), worst
    if best is None:
        return None
    axis, centre = best
    flips = [t for t in found if axis @ t[:3, :3] @ axis < 0]
    return Symmetry(np.array([np.eye(4), *flips[:1]]), "axis", axis, centre)


class _Surface:
    """Comparison of a surface with itself after a motion, at touched points (K, 3).

    A thread or an inner wall that no gel reaches does not count. radius [m]: mean distance of the touched surface from
    its middle.
    """

    def __init__(self, mesh: ObjectMesh, touched: np.ndarray, tolerance: float, tried: Callable[[], object]):
        self.tolerance, self._tried = tolerance, tried
        self._mesh = mesh
        self._samples, self._sample_normals, _ = mesh.sample_surface(_SAMPLES, np.random.default_rng(0))
        self._tree = KDTree(self._samples)
        seen = np.unique(self._tree.query(touched)[1])[:_POINTS]  # samples are in random order
        self._points, self._normals = self._samples[seen], self._sample_normals[seen]
        self._near = tolerance + 3 * np.sqrt(mesh.area / _SAMPLES)
        self.radius = float(np.linalg.norm(self._points - self._points.mean(axis=0), axis=1).mean())

    def deviation(self, transform: np.ndarray) -> float:
        """Return the distance [m] within which `_FRACTION` of the surface, moved by (4, 4), lies from a surface that
        faces the same way."""
        self._tried()
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
        """Return those of motions (K, 4, 4) that fit best before alignment, far from each other and the identity."""
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
        """Return the motion (4, 4) after point-to-plane alignment (Chen and Medioni 1992); far points count less."""
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
            # unconstrained directions (about an axis of symmetry) stay as they are
            step = np.linalg.pinv(hessian, rcond=1e-3, hermitian=True) @ (jacobian.T @ (weight * residual))
            turn = Rotation.from_rotvec(step[3:] / self.radius).as_matrix()
            transform = se3.make(turn, middle + step[:3] - turn @ middle) @ transform
        return transform


def _rotation_grid(n: int) -> np.ndarray:
    """Return n rotations (n, 3, 3) spread evenly over SO(3) (super-Fibonacci sampling, Alexa 2022)."""
    s = np.arange(n) + 0.5
    inner, outer = np.sqrt(s / n), np.sqrt(1 - s / n)
    alpha, beta = 2 * np.pi * s / np.sqrt(2), 2 * np.pi * s / 1.533751168755204
    rows = [inner * np.sin(alpha), inner * np.cos(alpha), outer * np.sin(beta), outer * np.cos(beta)]
    return Rotation.from_quat(np.stack(rows, axis=1)).as_matrix()
