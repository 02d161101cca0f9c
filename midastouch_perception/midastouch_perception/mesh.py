"""A known object: its triangles, surface sampling and exact closest-point queries.

Meshes are used as they are: non-manifold, open or self-touching scans work, because nothing here needs more
than a list of oriented triangles.
"""

from __future__ import annotations

import hashlib
from functools import cached_property
from pathlib import Path

import numba
import numpy as np
import trimesh

from .errors import InputError
from .files import require_file, sha256
from .nearest_points import WORTH_THREADS, NearestPoints
from .triangle_grid import TriangleGrid

_LARGEST_EXTENT = 2.0  # m; a sensor of 19 x 25 mm does not localise on anything larger


class ObjectMesh:
    """Triangles of one object in its own frame, metres.

    Attributes: vertices (V, 3) float64; faces (F, 3) int32, zero-area faces dropped, all turned round if the enclosed
    volume is negative (inverted mesh); face_normals (F, 3), outward; face_areas (F,) m^2; name; sha256, of the file it
    came from (of the arrays, if it came from none); path.
    """

    def __init__(self, vertices: np.ndarray, faces: np.ndarray, name: str, content: str, path: Path | None = None):
        self.vertices = np.ascontiguousarray(vertices, float)
        faces = np.ascontiguousarray(faces, np.int32)
        corners = self.vertices[faces]
        cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        doubled = np.linalg.norm(cross, axis=1)
        kept = doubled > 1e-14
        inward = np.einsum("fj,fj->", corners.mean(axis=1) - corners.mean(axis=(0, 1)), cross) < 0
        self.faces = np.ascontiguousarray(faces[kept][:, ::-1]) if inward else faces[kept]
        self.face_areas = doubled[kept] / 2
        self.face_normals = (-cross if inward else cross)[kept] / doubled[kept, None]
        self.name, self.sha256, self.path = name, content, path

    @classmethod
    def load(cls, path: str | Path) -> ObjectMesh:
        """Read a PLY, STL, OBJ or other mesh that trimesh knows, with its own vertex indexing.

        Raises InputError: no such file, not a mesh, no faces, non-finite vertices, larger than 2 m.
        """
        path = require_file(path, "mesh")
        try:
            loaded = trimesh.load(path, process=False, force="mesh")
            vertices, faces = np.asarray(loaded.vertices, float), np.asarray(loaded.faces)
        except Exception as error:  # trimesh raises a different type for each way a file can be broken
            reason = str(error) or type(error).__name__
            raise InputError(f"{path}: cannot be read as a mesh ({reason}); use PLY, STL or OBJ") from error
        mesh = cls.from_arrays(vertices, faces, path.stem, source=str(path))
        mesh.sha256, mesh.path = sha256(path), path.resolve()
        return mesh

    @classmethod
    def from_arrays(cls, vertices: np.ndarray, faces: np.ndarray, name: str, source: str | None = None) -> ObjectMesh:
        """A mesh from vertices (V, 3) m and faces (F, 3); raises InputError as `load` does, naming `source`."""
        source = source or name
        vertices, faces = np.asarray(vertices, float), np.asarray(faces)
        if vertices.ndim != 2 or faces.ndim != 2 or not len(faces):
            raise InputError(f"{source}: mesh without faces; export it as triangles, not as points")
        if vertices.shape[1] != 3 or faces.shape[1] != 3:
            raise InputError(f"{source}: faces of {faces.shape[1]} corners in {vertices.shape[1]}-D; export triangles")
        if not np.isfinite(vertices).all():
            raise InputError(f"{source}: mesh with non-finite vertices; export it again")
        strays = faces[(faces < 0) | (faces >= len(vertices))]
        if len(strays):
            raise InputError(f"{source}: a face names vertex {strays[0]} of {len(vertices)}; export it again")
        content = hashlib.sha256(vertices.tobytes() + faces.astype(np.int32).tobytes()).hexdigest()
        mesh = cls(vertices, faces, name, content)
        if not len(mesh.faces):
            raise InputError(f"{source}: every face has zero area; export the mesh again")
        extent = np.ptp(vertices[mesh.faces].reshape(-1, 3), axis=0).max()
        if extent > _LARGEST_EXTENT:
            raise InputError(f"{source}: {extent:.0f} m across; it looks like millimetres, scale it by 0.001 to metres")
        return mesh

    @cached_property
    def vertex_normals(self) -> np.ndarray:
        """(V, 3) unit normals, the mean of the adjacent faces' weighted by the angle at the vertex."""
        corners = self.vertices[self.faces]
        normals = np.zeros_like(self.vertices)
        for i in range(3):
            a = corners[:, (i + 1) % 3] - corners[:, i]
            b = corners[:, (i + 2) % 3] - corners[:, i]
            angle = np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), (a * b).sum(axis=1))
            np.add.at(normals, self.faces[:, i], angle[:, None] * self.face_normals)
        return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)

    @cached_property
    def bounds(self) -> np.ndarray:
        """(2, 3) lowest and highest corner [m] of the used vertices."""
        used = self.vertices[self.faces].reshape(-1, 3)
        return np.stack([used.min(axis=0), used.max(axis=0)])

    @property
    def diagonal(self) -> float:
        """Length [m] of the bounding box's diagonal, the paper's M_diag."""
        return float(np.linalg.norm(self.bounds[1] - self.bounds[0]))

    @property
    def area(self) -> float:
        """Surface area [m^2]."""
        return float(self.face_areas.sum())

    def sample_surface(self, n: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Draw n points uniformly by area: points (n, 3) m, face normals (n, 3), face indices (n,)."""
        # systematic over the faces: even coverage at the same cost as independent draws
        steps = (rng.permutation(n) + rng.random(n)) / n
        cumulative = np.cumsum(self.face_areas)
        index = np.minimum(np.searchsorted(cumulative, steps * cumulative[-1]), len(self.faces) - 1)
        r = np.sqrt(rng.random(n))
        s = rng.random(n)
        weights = np.stack([1 - r, r * (1 - s), r * s], axis=1)
        points = np.einsum("nk,nkj->nj", weights, self.vertices[self.faces[index]])
        return points, self.face_normals[index], index

    @cached_property
    def feature_edges(self) -> tuple[np.ndarray, np.ndarray]:
        """Edges where two faces meet at more than 10 deg: ends (E, 2, 3) m, mean normals (E, 3).

        Corners are matched by position, so scans split along seams keep their edges (paper appendix A).
        """
        _, welded = np.unique(self.vertices.round(7), axis=0, return_inverse=True)
        faces = welded.reshape(-1)[self.faces]
        edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        owner = np.repeat(np.arange(len(faces)), 3)
        ends = self.vertices[self.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)]
        order = np.lexsort(edges.T)
        same = (edges[order[1:]] == edges[order[:-1]]).all(axis=1)
        first, second = order[:-1][same], order[1:][same]
        a, b = self.face_normals[owner[first]], self.face_normals[owner[second]]
        sharp = (a * b).sum(axis=1) < np.cos(np.radians(10))
        normals = (a + b)[sharp]
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        usable = length[:, 0] > 1e-3  # two faces folded onto each other have no outward direction
        return ends[first[sharp][usable]], normals[usable] / length[usable]

    @cached_property
    def _normal_samples(self) -> tuple[NearestPoints, np.ndarray]:
        points, normals, _ = self.sample_surface(40_000, np.random.default_rng(0))
        return NearestPoints(points), normals

    def smooth_normals(self, points: np.ndarray, radius: float = 4e-3) -> np.ndarray:
        """Outward normals (N, 3) at surface points (N, 3), averaged with a Gaussian of `radius` m.

        This is how a finger pad of finite size feels the surface: it turns gradually over an edge.
        """
        tree, normals = self._normal_samples
        count = int(np.clip(8 * radius**2 * len(normals) / self.area, 8, 256))
        distance, index = tree.query(points, k=count)
        weight = np.exp(-0.5 * (distance / radius) ** 2)
        # opposite sides of a thin plate must not average out: keep the side that faces the nearest sample
        facing = np.einsum("nkj,nj->nk", normals[index], normals[index[:, 0]]) > -0.2
        mean = np.einsum("nk,nkj->nj", weight * facing, normals[index])
        return mean / np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-12)

    @cached_property
    def _search(self) -> _ClosestPointSearch:
        return _ClosestPointSearch(self.vertices, self.faces)

    def closest_points(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Exact nearest surface points of points (N, 3): closest (N, 3), distance (N,) m, face (N,)."""
        return self._search.query(np.ascontiguousarray(points, float))


class _ClosestPointSearch:
    """Exact closest point on a triangle soup.

    The triangle of the nearest surface sample bounds the distance; only the grid cells within that bound are
    searched for a nearer one.
    """

    def __init__(self, vertices: np.ndarray, faces: np.ndarray):
        corners = vertices[faces]
        volume = np.prod(np.maximum(np.ptp(corners.reshape(-1, 3), axis=0), 1e-3))
        self.grid = TriangleGrid(corners, max(float((volume / 250_000) ** (1 / 3)), 1e-3))
        self.samples, self.sample_faces = _cover(self.grid.corners, self.grid.cell)
        self.tree = NearestPoints(self.samples)

    def query(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        if not len(points):
            return np.empty((0, 3)), np.empty(0), np.empty(0, np.int64)
        _, nearest = self.tree.query(points, k=1)
        g = self.grid
        out = np.empty((len(points), 3)), np.empty(len(points)), np.empty(len(points), np.int64)
        search = _closest_in_turn if len(points) < WORTH_THREADS else _closest
        search(points, self.sample_faces[nearest], g.corners, g.origin, g.cell, g.shape, g.start, g.items, *out)
        return out


def _cover(corners: np.ndarray, spacing: float) -> tuple[np.ndarray, np.ndarray]:
    """Points on the triangles (F, 3, 3), at least the centroid and enough for `spacing`, with their faces."""
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    divisions = np.clip(np.ceil(edges / spacing), 1, 12).astype(int)
    points, faces = [], []
    for n in np.unique(divisions):
        chosen = np.flatnonzero(divisions == n)
        i, j = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
        inside = i + j < n
        b, c = (i[inside] + 1 / 3) / n, (j[inside] + 1 / 3) / n
        weights = np.stack([1 - b - c, b, c], axis=1)
        points.append(np.einsum("sk,fkj->fsj", weights, corners[chosen]).reshape(-1, 3))
        faces.append(np.repeat(chosen, len(weights)))
    return np.concatenate(points), np.concatenate(faces)


@numba.njit(cache=True, inline="always")
def _project(p, a, b, c, out):
    """Closest point of triangle abc to p into `out`; returns the squared distance (Ericson 2005, 5.1.5)."""
    ab0, ab1, ab2 = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    ac0, ac1, ac2 = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    ap0, ap1, ap2 = p[0] - a[0], p[1] - a[1], p[2] - a[2]
    d1 = ab0 * ap0 + ab1 * ap1 + ab2 * ap2
    d2 = ac0 * ap0 + ac1 * ap1 + ac2 * ap2
    bp0, bp1, bp2 = p[0] - b[0], p[1] - b[1], p[2] - b[2]
    d3 = ab0 * bp0 + ab1 * bp1 + ab2 * bp2
    d4 = ac0 * bp0 + ac1 * bp1 + ac2 * bp2
    cp0, cp1, cp2 = p[0] - c[0], p[1] - c[1], p[2] - c[2]
    d5 = ab0 * cp0 + ab1 * cp1 + ab2 * cp2
    d6 = ac0 * cp0 + ac1 * cp1 + ac2 * cp2
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    if d1 <= 0 and d2 <= 0:
        v, w = 0.0, 0.0
    elif d3 >= 0 and d4 <= d3:
        v, w = 1.0, 0.0
    elif vc <= 0 and d1 >= 0 and d3 <= 0:
        v, w = d1 / (d1 - d3), 0.0
    elif d6 >= 0 and d5 <= d6:
        v, w = 0.0, 1.0
    elif vb <= 0 and d2 >= 0 and d6 <= 0:
        v, w = 0.0, d2 / (d2 - d6)
    elif va <= 0 and d4 - d3 >= 0 and d5 - d6 >= 0:
        w = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        v = 1.0 - w
    else:
        total = 1.0 / (va + vb + vc)
        v, w = vb * total, vc * total
    out[0] = a[0] + ab0 * v + ac0 * w
    out[1] = a[1] + ab1 * v + ac1 * w
    out[2] = a[2] + ab2 * v + ac2 * w
    return (p[0] - out[0]) ** 2 + (p[1] - out[1]) ** 2 + (p[2] - out[2]) ** 2


@numba.njit(cache=True, parallel=True)
def _closest(points, guess, corners, origin, cell, shape, start, items, closest, distance, face):
    for i in numba.prange(points.shape[0]):
        distance[i], face[i] = _closest_to(points[i], guess[i], corners, origin, cell, shape, start, items, closest[i])


@numba.njit(cache=True)
def _closest_in_turn(points, guess, corners, origin, cell, shape, start, items, closest, distance, face):
    for i in range(points.shape[0]):
        distance[i], face[i] = _closest_to(points[i], guess[i], corners, origin, cell, shape, start, items, closest[i])


@numba.njit(cache=True)
def _closest_to(p, guess, corners, origin, cell, shape, start, items, closest):
    """Closest surface point to p into `closest`, beginning with triangle `guess`; returns distance and triangle."""
    candidate = np.empty(3)
    best = guess
    best_squared = _project(p, corners[best, 0], corners[best, 1], corners[best, 2], closest)
    reach = np.sqrt(best_squared)
    low, high = np.empty(3, np.int64), np.empty(3, np.int64)
    for k in range(3):
        low[k] = max(int(np.floor((p[k] - reach - origin[k]) / cell)), 0)
        high[k] = min(int(np.floor((p[k] + reach - origin[k]) / cell)), shape[k] - 1)
    for x in range(low[0], high[0] + 1):
        for y in range(low[1], high[1] + 1):
            for z in range(low[2], high[2] + 1):
                # a cell whose nearest point is beyond the best triangle so far cannot hold a nearer one
                gap = 0.0
                for k, cell_index in enumerate((x, y, z)):
                    edge = origin[k] + cell_index * cell
                    outside = max(edge - p[k], p[k] - edge - cell, 0.0)
                    gap += outside * outside
                if gap > best_squared:
                    continue
                c = (x * shape[1] + y) * shape[2] + z
                for j in range(start[c], start[c + 1]):
                    f = items[j]
                    squared = _project(p, corners[f, 0], corners[f, 1], corners[f, 2], candidate)
                    if squared < best_squared:
                        best_squared, best = squared, f
                        closest[0], closest[1], closest[2] = candidate[0], candidate[1], candidate[2]
    return np.sqrt(best_squared), best
