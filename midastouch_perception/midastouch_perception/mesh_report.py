"""Report on a mesh that a sensor touches from outside: its size, shells, edges and visible sides, and what to fix."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_common.mesh_units import unit_advice
from midastouch_common.surface_search import RaySearch

from .sensor_model import SensorModel

_POINTS = 600  # on the surface, so that 6 of them are 1 %
_RAYS = 16  # from each side of a point
_MORE_RAYS = 144  # from points where no ray led outside: few rays from the inside of a cup do
_OFF_SURFACE = 1e-5  # m between surface and start of a ray
_TWO_SIDED = 0.5  # at a sheet, at least this ratio of free rays from the back to free rays from the front
# Fractions of the area. None of 78 YCB scans is inside out or a sheet; of one, a mug, 6 % are hidden, of others 1 %.
_MOST_INSIDE_OUT, _MOST_HIDDEN = 0.02, 0.5  # more, and too many poses would lie within the object
_NOTABLE_HIDDEN = 0.02
_MANY_BRANCHING = 0.001  # of the edges; the scans have 3 of 25,000
_LONG = 0.5  # m; a longer object is explored for minutes
_MANY_FACES = 1_000_000  # with more, every step takes minutes, for detail finer than a pixel


@dataclasses.dataclass(frozen=True)
class MeshReport:
    """Report on a mesh. Attributes: source, file or name; size (3,) m, of the bounding box; numbers of faces, shells
    (parts that are not connected), inner_shells (those that cannot be seen from outside), edges, open_edges (of one
    face) and branching_edges (of more than two); fractions of the area that are inside_out (seen from the back), hidden
    (seen from neither side) and two_sided (seen from both).
    """

    source: str
    size: tuple[float, ...]
    faces: int
    shells: int
    inner_shells: int
    edges: int
    open_edges: int
    branching_edges: int
    inside_out: float
    hidden: float
    two_sided: float

    @classmethod
    def of(cls, mesh: ObjectMesh) -> MeshReport:
        """Examine a mesh from many sides; the same mesh always gets the same report."""
        edges = np.sort(mesh.face_edges, axis=2)
        faces_of_edge = np.unique(edges.reshape(-1, 2), axis=0, return_counts=True)[1]
        shell_of_face = _shells(edges)
        points, normals, face = mesh.sample_surface(_POINTS, np.random.default_rng(0))
        front, back = exposure(mesh, points, normals)
        shell, hidden = shell_of_face[face], (front == 0) & (back == 0)
        return cls(
            source=str(mesh.path or mesh.name),
            size=tuple(np.ptp(mesh.bounds, axis=0).tolist()),
            faces=len(mesh.faces),
            shells=int(shell_of_face.max()) + 1,
            inner_shells=len(np.setdiff1d(shell[hidden], shell[~hidden])),
            edges=len(faces_of_edge),
            open_edges=int((faces_of_edge == 1).sum()),
            branching_edges=int((faces_of_edge > 2).sum()),
            inside_out=float((back > front).mean()),
            hidden=float(hidden.mean()),
            two_sided=float(((back > _TWO_SIDED * front) & (back <= front)).mean()),
        )

    @classmethod
    def tell(cls, mesh: ObjectMesh, sensor: SensorModel, inform: Callable[[str], None]) -> None:
        """Give the lines of the report on a mesh to `inform`; InputError if it cannot be used, as `require_usable`."""
        report = cls.of(mesh)
        report.require_usable()
        for line in report.lines(sensor):
            inform(line)

    def require_usable(self) -> None:
        """Raise InputError, with advice, if too many poses on the mesh would lie within the object."""
        if self.inside_out > _MOST_INSIDE_OUT:
            doubled = "remove doubled faces, then " if self._branches else ""
            raise InputError(
                f"{self.source}: {self.inside_out:.0%} of the surface is inside out; {doubled}let your modelling "
                "program recalculate the normals outward (Blender: Mesh > Normals > Recalculate Outside), and export "
                "it again"
            )
        if self.hidden > _MOST_HIDDEN:
            raise InputError(f"{self.source}: {self._hidden_and_fix}")

    def lines(self, sensor: SensorModel) -> Iterator[str]:
        """Yield the size in one line, of a mesh with problems all of the report; then each problem with this sensor in
        one line, with its fix."""
        problems = list(self._problems(sensor))
        if not (problems or self.open_edges or self.branching_edges):
            yield f"{self.source}: {_millimetres(self.size)}, closed"
            return
        yield (
            f"{self.source}: {_millimetres(self.size)}; faces: {self.faces}; shells: {self.shells}, of them inside: "
            f"{self.inner_shells}; open edges: {self.open_edges}, of more than two faces: {self.branching_edges}; "
            f"{self.inside_out:.1%} of the area inside out, {self.hidden:.1%} hidden"
        )
        for problem in problems:
            yield f"warning: {self.source}: {problem}"

    def _problems(self, sensor: SensorModel) -> Iterator[str]:
        gel = sorted((sensor.width * sensor.pixel_size, sensor.height * sensor.pixel_size))
        if all(side < limit for side, limit in zip(sorted(self.size)[1:], gel, strict=True)):
            yield (
                f"it is smaller than the gel of {_millimetres(gel)}, so that few poses can be told apart (midastouch "
                "single-touch measures how few); if the object is larger than that, scale the mesh to metres"
            )
        if (longest := max(self.size)) > _LONG:
            yield f"it is {longest:.3g} m long if it is in metres; {unit_advice(longest)}"
        if self.faces > _MANY_FACES:
            yield f"{self.faces} faces take minutes; reduce them to faces of 0.5 mm (Blender: modifier Decimate)"
        if self.hidden > _NOTABLE_HIDDEN:
            yield self._hidden_and_fix
        if self._branches:
            yield (
                f"{self.branching_edges} edges have more than two faces; remove doubled faces and inner walls "
                "(Blender: Merge > By Distance, then Select > All by Trait > Interior Faces)"
            )
        if self.open_edges and self.two_sided:
            yield (
                f"{self.two_sided:.1%} of the surface is seen from behind, too: it is a sheet without thickness, which "
                "is touched on its front only, or the wall around a large hole; remove it if it is no part of the "
                "object, make it thick (Blender: modifier Solidify), or close the hole (Mesh > Clean Up > Fill Holes)"
            )
        elif self.open_edges:
            yield (
                f"{self.open_edges} open edges around holes, where nothing can be touched; close them (Blender: Mesh > "
                "Clean Up > Fill Holes)"
            )

    @property
    def _branches(self) -> bool:
        return self.branching_edges > _MANY_BRANCHING * self.edges

    @property
    def _hidden_and_fix(self) -> str:
        shells = f", {self.inner_shells} of {self.shells} shells wholly" if self.inner_shells else ""
        return (
            f"{self.hidden:.0%} of the surface lies inside the object{shells}: no finger gets there, but poses of the "
            "codebook do; remove walls of cavities, inner parts and inner walls"
        )


def _millimetres(lengths: Sequence[float]) -> str:
    return " x ".join(f"{1e3 * length:.0f}" if length >= 1 else f"{1e3 * length:.3g}" for length in lengths) + " mm"


def _shells(edges: np.ndarray) -> np.ndarray:
    """Return the number (F,) of each face's shell, from the faces' edges (F, 3, 2)."""
    ends = edges.reshape(-1, 2)
    count = int(ends.max()) + 1
    graph = coo_matrix((np.ones(len(ends), bool), (ends[:, 0], ends[:, 1])), (count, count))
    label = connected_components(graph, directed=False)[1]
    return np.unique(label[edges[:, 0, 0]], return_inverse=True)[1]


def exposure(mesh: ObjectMesh, points: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the fractions (N,) of rays that get away from the front and from the back of surface points (N, 3) with
    normals (N, 3); a finger gets to none of both if they are 0."""
    search, rng = RaySearch(mesh.vertices, mesh.faces), np.random.default_rng(0)
    front, back = (_free(search, points, side * normals, _RAYS, rng) for side in (1, -1))
    unseen = np.flatnonzero((front == 0) & (back == 0))
    for seen, side in ((front, 1), (back, -1)):
        seen[unseen] = _free(search, points[unseen], side * normals[unseen], _MORE_RAYS, rng)
    return front, back


def _free(
    search: RaySearch, points: np.ndarray, normals: np.ndarray, rays: int, rng: np.random.Generator
) -> np.ndarray:
    """Return the fraction (N,) of `rays` random rays from each point (N, 3), on its normal's side, that are free."""
    directions = rng.standard_normal((len(points), rays, 3))
    directions *= np.sign(np.einsum("nkj,nj->nk", directions, normals))[..., None]
    origins = np.repeat(points + _OFF_SURFACE * normals, rays, axis=0)
    return 1 - search.meets(origins, directions.reshape(-1, 3)).reshape(-1, rays).mean(axis=1)
