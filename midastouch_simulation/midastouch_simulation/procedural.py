"""Procedural shapes: signed distance functions turned into meshes by surface nets (Gibson 1998).

They give the networks shapes that no scan has (sharp ridges, screws, ripples, the detail of letters), and the demo its
bundled objects. A signed distance function maps points (N, 3) m to distances (N,) m, negative inside.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh

_BLOCK = 6  # grid points along each side that are sampled together
_STEEPEST = 1.8  # largest change of a function per metre; ripples make it more than 1

Sdf = Callable[[np.ndarray], np.ndarray]


def sphere(radius: float) -> Sdf:
    """Return a ball around the origin."""
    return lambda p: np.linalg.norm(p, axis=1) - radius


def box(half: tuple[float, float, float], rounding: float = 0.0) -> Sdf:
    """Return an axis-aligned box with half sizes `half`, its edges rounded by `rounding`."""
    inner = np.asarray(half) - rounding

    def distance(p: np.ndarray) -> np.ndarray:
        q = np.abs(p) - inner
        return np.linalg.norm(np.maximum(q, 0), axis=1) + np.minimum(q.max(axis=1), 0) - rounding

    return distance


def cylinder(radius: float, half_height: float, rounding: float = 0.0) -> Sdf:
    """Return a cylinder around z."""

    def distance(p: np.ndarray) -> np.ndarray:
        q = np.stack([np.hypot(p[:, 0], p[:, 1]) - radius, np.abs(p[:, 2]) - half_height], axis=1) + rounding
        return np.linalg.norm(np.maximum(q, 0), axis=1) + np.minimum(q.max(axis=1), 0) - rounding

    return distance


def torus(major: float, minor: float) -> Sdf:
    """Return a ring around z."""
    return lambda p: np.hypot(np.hypot(p[:, 0], p[:, 1]) - major, p[:, 2]) - minor


def placed(shape: Sdf, pose: np.ndarray) -> Sdf:
    """Return `shape` moved by the rigid transform `pose` (4, 4)."""
    back = se3.inverse(pose)
    return lambda p: shape(p @ back[:3, :3].T + back[:3, 3])


def at(
    shape: Sdf, x: float = 0.0, y: float = 0.0, z: float = 0.0, turn: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> Sdf:
    """Return `shape` turned by the rotation vector `turn` [rad], then moved to (x, y, z) [m]."""
    pose = se3.exp(np.array([0, 0, 0, *turn]))
    pose[:3, 3] = x, y, z
    return placed(shape, pose)


def union(*shapes: Sdf, blend: float = 0.0) -> Sdf:
    """Return the union of the shapes, their seams filleted over `blend` m."""

    def distance(p: np.ndarray) -> np.ndarray:
        out = shapes[0](p)
        for shape in shapes[1:]:
            other = shape(p)
            if blend:
                h = np.clip(0.5 + 0.5 * (other - out) / blend, 0, 1)
                out = other * (1 - h) + out * h - blend * h * (1 - h)
            else:
                out = np.minimum(out, other)
        return out

    return distance


def difference(shape: Sdf, *tools: Sdf) -> Sdf:
    """Return `shape` with the tools cut away."""
    return lambda p: np.maximum(shape(p), -np.min([tool(p) for tool in tools], axis=0))


def rippled(shape: Sdf, amplitude: float, wavelength: float, direction: npt.ArrayLike) -> Sdf:
    """Return `shape` with ridges of `amplitude` and `wavelength` m across `direction` (3,)."""
    wave = 2 * np.pi / wavelength * np.asarray(direction) / np.linalg.norm(direction)
    return lambda p: shape(p) - amplitude * np.sin(p @ wave)


def _sampled(shape: Sdf, axes: list[np.ndarray], spacing: float) -> np.ndarray:
    """Sample distances (I, J, K) on a grid; away from the surface one value, of the right sign, for a whole block."""
    blocks = [[a[i : i + _BLOCK] for i in range(0, len(a), _BLOCK)] for a in axes]
    middles = [np.array([0.5 * (b[0] + b[-1]) for b in along]) for along in blocks]
    centres = np.stack(np.meshgrid(*middles, indexing="ij"), axis=-1)
    values = shape(centres.reshape(-1, 3)).reshape(centres.shape[:3])
    near = np.abs(values) < _STEEPEST * 0.5 * np.sqrt(3) * _BLOCK * spacing
    for axis, along in enumerate(axes):
        values, near = (np.repeat(a, _BLOCK, axis=axis).take(range(len(along)), axis) for a in (values, near))
    points = np.stack([a[i] for a, i in zip(axes, np.nonzero(near), strict=True)], axis=1)
    values[near] = shape(points)
    return values


def mesh_from_sdf(shape: Sdf, half: np.ndarray, spacing: float, name: str) -> ObjectMesh:
    """Return the mesh of the zero level inside the box [-half, half] (3,) m, sampled every `spacing` m."""
    axes = [np.arange(-h - 2 * spacing, h + 2.5 * spacing, spacing) for h in half]
    values = _sampled(shape, axes, spacing)
    inside = values < 0
    corners = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    cells = tuple(s - 1 for s in values.shape)

    def shifted(array: np.ndarray, offset: np.ndarray) -> np.ndarray:
        return array[tuple(slice(o, o + c) for o, c in zip(offset, cells, strict=True))]

    count = sum(shifted(inside, c).astype(np.int8) for c in corners)
    active = np.argwhere((count > 0) & (count < 8))
    # one vertex per cell that the surface crosses: the mean of the crossings on its edges
    total, crossings = np.zeros((len(active), 3)), np.zeros(len(active))
    for a in corners:
        for k in np.flatnonzero(a == 0):
            b = a.copy()
            b[k] = 1
            va, vb = values[tuple((active + a).T)], values[tuple((active + b).T)]
            crossed = (va < 0) != (vb < 0)
            t = np.where(crossed, va / np.where(crossed, va - vb, 1), 0)
            total[crossed] += (a + t[:, None] * (b - a))[crossed]
            crossings += crossed
    origin = np.array([axis[0] for axis in axes])
    vertices = origin + spacing * (active + total / crossings[:, None])
    index = np.full(cells, -1, np.int64)
    index[tuple(active.T)] = np.arange(len(active))
    faces = []
    for axis in range(3):
        step = np.eye(3, dtype=int)[axis]
        u, v = np.eye(3, dtype=int)[(axis + 1) % 3], np.eye(3, dtype=int)[(axis + 2) % 3]
        shape_here = tuple(s - t for s, t in zip(inside.shape, step, strict=True))
        first = inside[tuple(slice(0, s) for s in shape_here)]
        second = inside[tuple(slice(t, t + s) for t, s in zip(step, shape_here, strict=True))]
        for edges, flipped in ((np.argwhere(first & ~second), False), (np.argwhere(~first & second), True)):
            if not len(edges):
                continue
            quad = np.stack([index[tuple((edges - o).T)] for o in (u + v, v, 0 * u, u)], axis=1)
            if flipped:
                quad = quad[:, ::-1]
            faces += [quad[:, [0, 1, 2]], quad[:, [0, 2, 3]]]
    return ObjectMesh.from_arrays(vertices, np.concatenate(faces), name)


def _primitive(size: float, rng: np.random.Generator) -> Sdf:
    kind = rng.integers(4)
    a, b, c = rng.uniform(0.25, 1, 3) * size
    if kind == 0:
        return sphere(a)
    if kind == 1:
        return box((a, b, c), rng.uniform(0, 0.3) * min(a, b, c))
    if kind == 2:
        return cylinder(a, b, rng.uniform(0, 0.3) * min(a, b))
    return torus(0.8 * size, rng.uniform(0.1, 0.35) * size)


def random_probe(rng: np.random.Generator, name: str) -> ObjectMesh:
    """Make a single ball, box, pin or ring of 5 ... 20 mm: large relative to the press, its outline within view."""
    size = rng.uniform(0.005, 0.01)
    return mesh_from_sdf(_primitive(size, rng), np.full(3, 1.2 * size), size / 40, name)


def random_shape(rng: np.random.Generator, name: str) -> ObjectMesh:
    """Make a random object of 40 ... 100 mm: blended and cut primitives, some rippled."""

    def anywhere(shape: Sdf, reach: float) -> Sdf:
        return placed(shape, se3.make(se3.random_rotations(1, rng)[0], rng.uniform(-reach, reach, 3)))

    size = rng.uniform(0.012, 0.03)
    shape = union(
        *(anywhere(_primitive(size, rng), size * 0.9) for _ in range(rng.integers(2, 6))),
        blend=rng.choice([0.0, 0.2]) * size,
    )
    cuts = [anywhere(_primitive(0.5 * size, rng), 1.5 * size) for _ in range(rng.integers(0, 4))]
    if cuts:
        shape = difference(shape, *cuts)
    if rng.random() < 0.5:
        wavelength = rng.uniform(2e-3, 1e-2)
        shape = rippled(shape, rng.uniform(0.02, 0.08) * wavelength, wavelength, rng.standard_normal(3))
    return mesh_from_sdf(shape, np.full(3, 2.6 * size), size / 28, name)
