"""Solids with flat walls and sharp edges, as in CAD exports: stacked layers of outlines, and lofted rings.

Lengths are in m. Both give closed meshes whose faces look outward, and the same ones at every call.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import Delaunay, cKDTree

from midastouch_common.mesh import ObjectMesh

Outline = np.ndarray
"""Closed polygon (N, 2)."""

_SAME = 1e-8  # m: corners nearer than this are one
_FAR = 10.0  # sizes of the part at which far corners put its own outline inside the triangulation


@dataclass(frozen=True)
class Layer:
    """Layer of a thickness [m], solid inside of any of the outlines, except inside of the cuts."""

    thickness: float
    outlines: tuple[Outline, ...]
    cuts: tuple[Outline, ...] = ()


def stacked(layers: Sequence[Layer], name: str) -> ObjectMesh:
    """Stack layers along z, centred at the plane z = 0.

    One triangulation in the plane contains the outlines of all layers, so that walls and ceilings meet corner to
    corner.
    """
    plane, triangles = _triangulated([each for layer in layers for each in (*layer.outlines, *layer.cuts)])
    middles = plane[triangles].mean(axis=1)
    solid = [np.zeros(len(triangles), bool), *(_solid(middles, layer) for layer in layers)]
    solid.append(solid[0])
    heights = np.cumsum([0.0, *(layer.thickness for layer in layers)])
    heights -= heights[-1] / 2
    faces = []
    for level, (below, above) in enumerate(pairwise(solid)):
        start = level * len(plane)
        faces += [start + triangles[below & ~above], start + triangles[above & ~below][:, ::-1]]
        a, b = _rim(triangles[above]).T + start
        up = len(plane)
        faces += [np.stack([a, b, b + up], axis=1), np.stack([a, b + up, a + up], axis=1)]
    vertices = np.concatenate([np.column_stack([plane, np.full(len(plane), height)]) for height in heights])
    used, index = np.unique(np.concatenate(faces), return_inverse=True)
    return ObjectMesh.from_arrays(vertices[used], index.reshape(-1, 3), name)


def _triangulated(outlines: list[Outline]) -> tuple[np.ndarray, np.ndarray]:
    """Return points (P, 2) and counter-clockwise triangles (T, 3), without far ones, with all outlines as sides."""
    starts = np.concatenate(outlines)
    ends = np.concatenate([np.roll(outline, -1, axis=0) for outline in outlines])
    points, edges = _crossed(starts, ends)
    size = np.ptp(points, axis=0).max()
    corners = _FAR * size * np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])
    while True:
        triangles = Delaunay(np.concatenate([points, corners])).simplices
        sides = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        missing = ~np.isin(edges @ [len(points) + 4, 1], np.unique(sides @ [len(points) + 4, 1]))
        if not missing.any():
            triangles = triangles[(triangles < len(points)).all(axis=1)]
            turned = _doubled_area(points[triangles]) < 0
            triangles[turned] = triangles[turned][:, ::-1]
            return points, triangles
        # an edge that is no side (its circle contains another point) is halved, until its parts are sides
        middle = len(points) + np.arange(missing.sum())
        points = np.concatenate([points, points[edges[missing]].mean(axis=1)])
        halves = [np.stack([edges[missing, k], middle], axis=1) for k in (0, 1)]
        edges = np.concatenate([edges[~missing], *halves])


def _crossed(starts: np.ndarray, ends: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Split edges that may cross or touch: return points (P, 2), and edges (E, 2) that meet only at their ends."""
    along = ends - starts
    between = starts[None] - starts[:, None]
    turn = _cross(along[:, None], along[None])
    with np.errstate(divide="ignore", invalid="ignore"):
        at = _cross(between, along[None]) / turn  # of the first edge of each pair
        of = _cross(between, along[:, None]) / turn
    length = np.linalg.norm(along, axis=1)
    slack = _SAME / length
    meets = (np.abs(turn) > 1e-9 * length[:, None] * length) & (at > slack[:, None]) & (at < 1 - slack[:, None])
    meets &= (of > -slack) & (of < 1 + slack)
    # corners that lie on an edge of the same direction
    fraction = (between * along[:, None]).sum(axis=2) / (length**2)[:, None]
    off = np.abs(_cross(between, along[:, None])) / length[:, None]
    touches = (off < _SAME) & (fraction > slack[:, None]) & (fraction < 1 - slack[:, None])
    pieces = []
    for k in range(len(starts)):
        cuts = np.sort(np.concatenate([[0.0, 1.0], at[k][meets[k]], fraction[k][touches[k]]]))
        corners = starts[k] + cuts[:, None] * along[k]
        pieces.append(np.stack([corners[:-1], corners[1:]], axis=1))
    corners = np.concatenate(pieces).reshape(-1, 2)
    # a wall through a corner crosses both walls that meet there, at points up to that distance from the corner
    near = cKDTree(corners).query_pairs(2 * _SAME, output_type="ndarray")
    links = coo_array((np.ones(len(near)), near.T), shape=(len(corners), len(corners)))
    _, group = connected_components(links, directed=False)
    _, first = np.unique(group, return_index=True)
    order = np.lexsort((corners[first] / _SAME).round().T[::-1])
    edges = np.unique(np.sort(np.argsort(order)[group].reshape(-1, 2), axis=1), axis=0)
    return corners[first[order]], edges[edges[:, 0] != edges[:, 1]]


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def _doubled_area(corners: np.ndarray) -> np.ndarray:
    return _cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def _solid(points: np.ndarray, layer: Layer) -> np.ndarray:
    """Return whether (N,) a layer is solid at points (N, 2)."""
    held, cut = (
        np.any([np.zeros(len(points), bool), *(_inside(points, each) for each in some)], axis=0)
        for some in (layer.outlines, layer.cuts)
    )
    return held & ~cut


def _inside(points: np.ndarray, outline: Outline) -> np.ndarray:
    """Return whether (N,) an outline encloses points (N, 2): a ray along x crosses it an odd number of times."""
    x, y = points[:, :1], points[:, 1:]
    a, b = outline, np.roll(outline, -1, axis=0)
    spans = (a[:, 1] > y) != (b[:, 1] > y)
    rise = np.where(a[:, 1] == b[:, 1], 1.0, b[:, 1] - a[:, 1])
    return (spans & (x < a[:, 0] + (y - a[:, 1]) / rise * (b[:, 0] - a[:, 0]))).sum(axis=1) % 2 == 1


def _rim(triangles: np.ndarray) -> np.ndarray:
    """Return the sides (E, 2) that only one of the triangles (T, 3) has, in that triangle's direction."""
    sides = triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    _, index, count = np.unique(np.sort(sides, axis=1), axis=0, return_inverse=True, return_counts=True)
    return sides[count[index.reshape(-1)] == 1]


def lofted(rings: npt.ArrayLike, name: str) -> ObjectMesh:
    """Join rings (N, 3) of equal numbers of points, ordered upwards and counter-clockwise from above, by walls.

    The first and the last ring are closed by a fan, so they must be flat and star-shaped about their middle."""
    rings = np.asarray(rings, float)
    levels, count = rings.shape[:2]
    here = np.arange(count)
    a, b = here, np.roll(here, -1)
    faces = []
    for level in range(levels - 1):
        low, high = level * count, (level + 1) * count
        faces += [np.stack([a + low, b + low, b + high], axis=1), np.stack([a + low, b + high, a + high], axis=1)]
    bottom, top = levels * count, levels * count + 1
    last = (levels - 1) * count
    faces += [np.stack([b, a, np.full(count, bottom)], axis=1), np.stack([a + last, b + last, np.full(count, top)], 1)]
    ends = rings[[0, -1]].mean(axis=1)
    return ObjectMesh.from_arrays(np.concatenate([rings.reshape(-1, 3), ends]), np.concatenate(faces), name)


def circle(radius: float, x: float = 0.0, y: float = 0.0, sides: int = 96) -> Outline:
    """Return a regular polygon whose first corner is at +x of its middle."""
    angles = 2 * np.pi * np.arange(sides) / sides
    return np.array([x, y]) + radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)


def rectangle(width: float, depth: float, x: float = 0.0, y: float = 0.0, chamfer: float = 0.0) -> Outline:
    """Return a rectangle along x and y; with a chamfer, with cut corners."""
    w, d = width / 2, depth / 2
    if not chamfer:
        return np.array([x, y]) + np.array([[-w, -d], [w, -d], [w, d], [-w, d]])
    c = chamfer
    corners = [[c - w, -d], [w - c, -d], [w, c - d], [w, d - c], [w - c, d], [c - w, d], [-w, d - c], [-w, c - d]]
    return np.array([x, y]) + np.array(corners)


def gear_outline(teeth: int, root: float, tip: float, missing: int = 0) -> Outline:
    """Return trapezoid teeth between two radii, the first one around +x, without the last `missing` ones."""
    pitch = 2 * np.pi / teeth
    corners = []
    for tooth in range(teeth):
        radii = (root, tip, tip, root) if tooth < teeth - missing else (root,) * 4
        for part, radius in zip((-0.28, -0.14, 0.14, 0.28), radii, strict=True):
            angle = (tooth + part) * pitch
            corners.append([radius * np.cos(angle), radius * np.sin(angle)])
    return np.array(corners)


def repeated(outline: Outline, count: int | np.integer) -> tuple[Outline, ...]:
    """Return `count` copies of the outline, evenly turned about the origin."""
    turns = 2 * np.pi * np.arange(count) / count
    cos, sin = np.cos(turns), np.sin(turns)
    rotations = np.stack([np.stack([cos, -sin], axis=1), np.stack([sin, cos], axis=1)], axis=1)
    return tuple(outline @ rotation.T for rotation in rotations)


def mirrored(layers: Sequence[Layer]) -> list[Layer]:
    """Return the mirror image of a stack across the plane x = 0."""
    image = np.array([-1.0, 1.0])
    return [Layer(each.thickness, *(tuple(o * image for o in some) for some in (each.outlines, each.cuts)))
            for each in layers]  # fmt: skip
