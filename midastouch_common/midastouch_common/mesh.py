"""Mesh of a known object: its triangles, surface sampling and exact closest-point queries.

Non-manifold, open or self-touching scans work: all the code here needs is a list of oriented triangles.
"""

from __future__ import annotations

import hashlib
import heapq
from functools import cached_property
from pathlib import Path

import numpy as np
import trimesh
from pykdtree.kdtree import KDTree
from scipy.spatial import cKDTree

import midastouch_kernels as kernels

from .errors import InputError
from .files import atomic_path, require_file, sha256
from .mesh_files import read_triangles
from .mesh_units import unit_advice
from .surface_search import ClosestPointSearch

_LARGEST_EXTENT = 2.0  # m; a sensor of 19 x 25 mm does not localise on anything larger
_SMALLEST_EXTENT = 1e-3  # m; a contact begins at 1.5 mm^2, which a smaller object cannot cause
FEWEST_THREADED_QUERIES = 8
"""Fewer nearest-point queries than this run in one thread: waking others can cost milliseconds on a busy machine."""

_CREASE_COSINE = np.cos(np.radians(40))
_SMALL_FACE = 6e-3  # m, longest side: the faces of scans of household objects are 2 to 6 mm wide
_THINNEST = 1e-4  # m; less is no solid, but a face that was never given its thickness
_EDGES = [[0, 1], [1, 2], [2, 0]]  # of a face, by its corners
_NO_AREA = 1e-14  # m^2, twice the area


def _same_position(vertices: np.ndarray) -> np.ndarray:
    """Return (V,) numbers that are equal for vertices (V, 3) at the same position."""
    return np.unique(vertices.round(7), axis=0, return_inverse=True)[1].reshape(-1)


def _crosses(corners: np.ndarray) -> np.ndarray:
    """Return normals (F, 3) of faces with corners (F, 3, 3), twice as long as their areas."""
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def _weld_slivers(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return faces (F, 3) of the same surface in which, as far as possible, no face is without area.

    A face without area lies along its longest edge; if it were left out, its neighbours would not meet there. Instead,
    the diagonal of the quadrilateral of this face and its neighbour at that edge is flipped, which splits the neighbour
    in two. The longest faces go first: their neighbour has an area, or their edges become shorter.
    """
    if (np.linalg.norm(_crosses(vertices[faces]), axis=1) > _NO_AREA).all():
        return faces
    faces, same = faces.copy(), _same_position(vertices)
    # a face with two corners at one position can simply be left out: its neighbours meet without it
    whole = np.flatnonzero((same[faces] != np.roll(same[faces], 1, axis=1)).all(axis=1))
    of_edge = {tuple(edge): f for f in whole.tolist() for edge in same[faces[f][_EDGES]].tolist()}

    def lengths(face: np.ndarray) -> np.ndarray:
        return np.linalg.norm(vertices[face] - vertices[np.roll(face, -1, axis=-1)], axis=-1)

    def without_area(chosen: np.ndarray) -> list[tuple[float, int]]:
        few = chosen[np.linalg.norm(_crosses(vertices[faces[chosen]]), axis=1) <= _NO_AREA]
        return list(zip((-lengths(faces[few]).max(axis=1)).tolist(), few.tolist(), strict=True))

    slivers = sorted(without_area(whole))
    while slivers:
        length, sliver = heapq.heappop(slivers)
        a, b, middle = np.roll(faces[sliver], -lengths(faces[sliver]).argmax())
        other = of_edge.get((same[b], same[a]))
        if without_area(np.array([sliver])) != [(length, sliver)] or other is None:  # changed since, or next to a hole
            continue
        apex = faces[other][~np.isin(same[faces[other]], same[[a, b]])]
        if len(apex) != 1:
            continue
        faces[sliver], faces[other] = (middle, a, apex[0]), (apex[0], b, middle)
        changed = np.array([sliver, other])
        of_edge |= {tuple(edge): f for f in changed.tolist() for edge in same[faces[f][_EDGES]].tolist()}
        for each in without_area(changed):
            heapq.heappush(slivers, each)
    return faces


class ObjectMesh:
    """Triangles of one object in its own frame, metres.

    Attributes: vertices (V, 3) float64; faces (F, 3) int32; face_normals (F, 3), outward; face_areas (F,) m^2; name;
    sha256; path of the file or None. Faces without area are welded into their neighbours. If the enclosed volume is
    negative (inverted mesh), all faces are turned round.

    Parameters
    ----------
    vertices : (V, 3) [m]
    faces : (F, 3) indices
    name
    content
        SHA-256 of the file, or of the arrays if there is no file.
    path
    """

    def __init__(self, vertices: np.ndarray, faces: np.ndarray, name: str, content: str, path: Path | None = None):
        self.vertices = np.ascontiguousarray(vertices, float)
        faces = _weld_slivers(self.vertices, np.ascontiguousarray(faces, np.int32))
        corners = self.vertices[faces]
        cross = _crosses(corners)
        doubled = np.linalg.norm(cross, axis=1)
        kept = doubled > _NO_AREA
        inward = np.einsum("fj,fj->", corners.mean(axis=1) - corners.mean(axis=(0, 1)), cross) < 0
        self.faces = np.ascontiguousarray(faces[kept][:, ::-1]) if inward else faces[kept]
        self.face_areas = doubled[kept] / 2
        self.face_normals = (-cross if inward else cross)[kept] / doubled[kept, None]
        self.name, self.sha256, self.path = name, content, path

    @classmethod
    def load(cls, path: str | Path) -> ObjectMesh:
        """Read a PLY, STL, OBJ or other mesh that trimesh knows, with its own vertex indexing.

        Parameters
        ----------
        path
            File in metres.

        Returns
        -------
        ObjectMesh
            The mesh, named after the file.

        Raises
        ------
        InputError
            There is no such file, it is no mesh, or the mesh has no faces, has non-finite vertices, is larger than 2 m,
            smaller than 1 mm or, in any direction, thinner than 0.1 mm.
        """
        path = require_file(path, "mesh")
        if path.suffix.lower() in (".step", ".stp"):
            raise InputError(f"{path}: STEP holds surfaces, no triangles; export it from your CAD as STL, in metres")
        try:
            vertices, faces = read_triangles(path)
        except InputError:
            raise
        except Exception as error:  # trimesh raises a different type for each way a file can be broken
            reason = str(error) or type(error).__name__
            raise InputError(f"{path}: cannot be read as a mesh ({reason}); use PLY, STL or OBJ") from error
        mesh = cls.from_arrays(vertices, faces, path.stem, path)
        if (thickness := mesh.thickness) < _THINNEST:
            raise InputError(f"{path}: {1e3 * thickness:.2f} mm thick; give the object a thickness and export it again")
        mesh.sha256, mesh.path = sha256(path), path.resolve()
        return mesh

    @classmethod
    def from_arrays(cls, vertices: np.ndarray, faces: np.ndarray, name: str, path: Path | None = None) -> ObjectMesh:
        """Make a mesh of any thickness from arrays.

        Parameters
        ----------
        vertices : (V, 3) [m]
        faces : indices (F, 3), counter-clockwise seen from outside
        name
        path
            File to name in messages.

        Raises
        ------
        InputError
            As for `load` otherwise.
        """
        source = path or name
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
            raise InputError(f"{source}: {extent:.3g} m across; {unit_advice(extent, path)}")
        if extent < _SMALLEST_EXTENT:
            raise InputError(f"{source}: {1e3 * extent:.2g} mm across, too small to touch; export it in metres")
        return mesh

    def save(self, path: str | Path) -> None:
        """Write vertices (in single precision) and faces in the format of the path's suffix."""
        with atomic_path(path) as temporary:
            trimesh.Trimesh(self.vertices.astype(np.float32), self.faces, process=False).export(temporary)

    def refined(self, edge: float) -> ObjectMesh:
        """Return the same surface with its faces subdivided until no edge is longer than `edge` [m]."""
        vertices, faces = trimesh.remesh.subdivide_to_size(self.vertices, self.faces, edge, max_iter=20)
        return ObjectMesh(vertices, faces, self.name, self.sha256)

    @cached_property
    def _welded(self) -> np.ndarray:
        """(V,) numbers that are equal for vertices at the same position."""
        return _same_position(self.vertices)

    @cached_property
    def vertex_normals(self) -> np.ndarray:
        """(V, 3) unit normals, the mean of the adjacent faces' weighted by the angle at the vertex.

        Corners are matched by position: an STL has no common vertices, and scans are split along seams.
        """
        corners = self.vertices[self.faces]
        normals = np.zeros_like(self.vertices)
        for i in range(3):
            a = corners[:, (i + 1) % 3] - corners[:, i]
            b = corners[:, (i + 2) % 3] - corners[:, i]
            angle = np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), (a * b).sum(axis=1))
            np.add.at(normals, self._welded[self.faces[:, i]], angle[:, None] * self.face_normals)
        normals = normals[self._welded]
        return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)

    @cached_property
    def corner_normals(self) -> np.ndarray:
        """(F, 3, 3) unit normals of the surface that the triangles approximate, one for each corner of a face.

        Where faces meet at less than 40 deg, the surface is smooth; a wider angle is an edge, as on CAD parts.
        Small faces are smooth at any angle: an edge of a scan is as round as its faces are wide.
        """
        corners = self._welded[self.faces].astype(np.int32)
        order = np.argsort(corners.ravel(), kind="stable")
        start = np.searchsorted(corners.ravel()[order], np.arange(corners.max() + 2))
        weighted = self.face_normals * self.face_areas[:, None]
        sharp = kernels.corner_normals(corners, self.face_normals, weighted, order // 3, start, _CREASE_COSINE)
        sides = self.vertices[self.faces[:, _EDGES]]
        longest = np.linalg.norm(sides[:, :, 0] - sides[:, :, 1], axis=2).max(axis=1)
        return np.where(longest[:, None, None] > _SMALL_FACE, sharp, self.vertex_normals[self.faces])

    @cached_property
    def bounds(self) -> np.ndarray:
        """(2, 3) lowest and highest corner [m] of the used vertices."""
        used = self.vertices[self.faces].reshape(-1, 3)
        return np.stack([used.min(axis=0), used.max(axis=0)])

    @property
    def thickness(self) -> float:
        """Extent [m] along the principal axis in which it is smallest."""
        used = self.vertices[self.faces].reshape(-1, 3)
        return float(np.ptp(used @ np.linalg.eigh(np.cov(used.T))[1][:, 0]))

    @property
    def diagonal(self) -> float:
        """Length [m] of the bounding box's diagonal, the paper's M_diag."""
        return float(np.linalg.norm(self.bounds[1] - self.bounds[0]))

    @property
    def area(self) -> float:
        """Surface area [m^2]."""
        return float(self.face_areas.sum())

    def sample_surface(self, n: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Draw points uniformly by area.

        Parameters
        ----------
        n
        rng

        Returns
        -------
        points, normals : (n, 3)
            Points [m] and outward normals of their faces.
        faces : (n,)
            Indices of the faces.
        """
        # systematic sampling over the faces: even coverage at the same cost as independent draws
        steps = (rng.permutation(n) + rng.random(n)) / n
        cumulative = np.cumsum(self.face_areas)
        index = np.minimum(np.searchsorted(cumulative, steps * cumulative[-1]), len(self.faces) - 1)
        r = np.sqrt(rng.random(n))
        s = rng.random(n)
        weights = np.stack([1 - r, r * (1 - s), r * s], axis=1)
        points = np.einsum("nk,nkj->nj", weights, self.vertices[self.faces[index]])
        return points, self.face_normals[index], index

    @property
    def face_edges(self) -> np.ndarray:
        """(F, 3, 2) numbers of both ends of each face's edges.

        Corners at the same position have the same number, so scans split along seams keep their edges.
        """
        return self._welded[self.faces][:, _EDGES]

    @cached_property
    def _shared_edges(self) -> tuple[np.ndarray, np.ndarray]:
        """Edges that two faces have in common: indices (E,) and (E,) of the edge in each, into all faces' edges."""
        ends = np.sort(self.face_edges.reshape(-1, 2), axis=1)
        order = np.lexsort(ends.T)
        same = (ends[order[1:]] == ends[order[:-1]]).all(axis=1)
        return order[:-1][same], order[1:][same]

    @cached_property
    def feature_edges(self) -> tuple[np.ndarray, np.ndarray]:
        """Edges at which two faces meet at more than 10 deg: ends (E, 2, 3) m, mean normals (E, 3).

        Source: paper appendix A.
        """
        first, second = self._shared_edges
        ends = self.vertices[self.faces[:, _EDGES].reshape(-1, 2)]
        a, b = self.face_normals[first // 3], self.face_normals[second // 3]
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
        """Average outward normals: the mean turns gradually over an edge, as a finger pad of finite size does.

        Parameters
        ----------
        points : (N, 3) [m], on the surface
        radius : standard deviation of the Gaussian [m]

        Returns
        -------
        (N, 3) unit normals
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
    def _search(self) -> ClosestPointSearch:
        return ClosestPointSearch(self.vertices, self.faces)

    def closest_points(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Find the exact nearest surface points.

        Parameters
        ----------
        points : (N, 3) [m]

        Returns
        -------
        closest : (N, 3)
            Surface points [m]; NaN for a point that is not finite.
        distance : (N,)
            Distances [m].
        face : (N,)
            Indices of the faces; 0 for a point that is not finite.
        """
        return self._search.query(np.ascontiguousarray(points, float))


class NearestPoints:
    """KD-tree of points (M, D), for many queries at once or one after another."""

    def __init__(self, points: np.ndarray):
        self._points = points
        self._threaded = KDTree(points)

    @cached_property
    def _unthreaded(self) -> cKDTree:
        return cKDTree(self._points)

    def query(self, queries: np.ndarray, k: int) -> tuple[np.ndarray, np.ndarray]:
        """Return distances and indices (N, k) of the k points nearest to queries (N, D), in order; (N,) for k = 1."""
        tree = self._unthreaded if len(queries) < FEWEST_THREADED_QUERIES else self._threaded
        return tree.query(np.ascontiguousarray(queries, float), k=k)
