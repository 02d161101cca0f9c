"""Distance of the gel's apex to the object's surface (paper appendix C).

The paper prunes particles further than 2 mm from the nearest mesh vertex. Vertices are not the surface, so the
signed distance to the surface itself is stored on a grid: filled exactly near the surface, saturated elsewhere,
interpolated trilinearly.
"""

from __future__ import annotations

import numpy as np

import midastouch_kernels as kernels
from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh

from .workers import Workers

DEAD_DISTANCE = 6e-3
"""m: a gel further from the surface than this touches nothing."""
_LARGEST_GRID = 4_000_000  # nodes, 2 bytes each
_FINEST = 1.5e-3  # m; trilinear interpolation then errs by 0.06 mm if the radius of curvature is 5 mm
_UNIT = 1e-6  # m per stored integer
_COARSE = 4  # fine nodes per coarse one while building


class SurfaceGrid:
    """Signed distance to a mesh's surface, negative inside, correct within `band` metres of it.

    Args: mesh; band; workers that interpolate; values of an earlier grid of this mesh and band, if there are any.
    Attributes: spacing m, of the nodes; limit m, where distances saturate, a little more than `band`; values (X, Y, Z)
    int16, the distances in micrometres.
    """

    def __init__(self, mesh: ObjectMesh, band: float, workers: Workers, values: np.ndarray | None = None):
        self._band, self._workers = band, workers
        # a cell with one saturated corner interpolates wrongly: keep such cells out of the band
        self.limit = band + 2 * _FINEST
        low, high = mesh.bounds
        margin = self.limit + _FINEST
        volume = float(np.prod(high - low + 2 * margin))
        self.spacing = max(_FINEST, (volume / _LARGEST_GRID) ** (1 / 3))
        self._origin = low - margin
        counts = np.ceil((high + margin - self._origin) / self.spacing).astype(int) + 1
        if values is None:
            self.values = np.full(counts, round(self.limit / _UNIT), np.int16)
            self._fill(mesh)
        elif values.shape == tuple(counts) and values.dtype == np.int16:
            self.values = np.ascontiguousarray(values)
        else:
            raise InputError(f"distances {values.shape} do not fit a grid of {tuple(counts)}")
        self._origin32 = self._origin.astype(np.float32)

    def _fill(self, mesh: ObjectMesh) -> None:
        shape = np.array(self.values.shape)
        blocks = np.stack(np.meshgrid(*[np.arange(0, n, _COARSE) for n in shape], indexing="ij"), axis=-1).reshape(
            -1, 3
        )
        half_block = 0.5 * (_COARSE - 1) * self.spacing
        offsets = np.stack(np.meshgrid(*[np.arange(_COARSE)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)

        def nodes(chosen: np.ndarray) -> np.ndarray:
            out = (blocks[chosen, None] + offsets).reshape(-1, 3)
            return out[(out < shape).all(axis=1)]

        # a block's nodes lie within half its diagonal of its centre: blocks beyond `reach` hold saturated nodes only
        centre = signed_distance(mesh, self._origin + blocks * self.spacing + half_block)
        reach = self.limit + np.sqrt(3) * half_block
        self.values[tuple(nodes(centre < -reach).T)] = -round(self.limit / _UNIT)
        near = nodes(np.abs(centre) <= reach)
        signed = signed_distance(mesh, self._origin + near * self.spacing)
        self.values[tuple(near.T)] = np.clip(signed, -self.limit, self.limit) / _UNIT

    def distance(self, positions: np.ndarray) -> np.ndarray:
        """Return signed distances (N,) float32 [m] of positions (N, 3): -`limit` deep inside, inf beyond the band."""
        positions, out = np.ascontiguousarray(positions, np.float32), np.empty(len(positions), np.float32)

        def interpolate(low: int, high: int, _: int) -> None:
            kernels.interpolate_grid(
                low, high, positions, self.values, self._origin32, 1 / self.spacing, _UNIT, self.limit, out
            )

        self._workers.run(len(positions), interpolate)
        out[out > self._band] = np.inf
        return out


def signed_distance(mesh: ObjectMesh, points: np.ndarray) -> np.ndarray:
    """Return signed distances (N,) [m] of points (N, 3), negative inside.

    The vertex normals, interpolated at the closest point, give the side (Baerentzen and Aanaes 2005): face
    normals give a wrong one beyond sharp edges, and ray counting fails on the holes of scans.
    """
    closest, distance, face = mesh.closest_points(points)
    corners = mesh.faces[face]
    a, b, c = (mesh.vertices[corners[:, k]] for k in range(3))
    doubled = 2 * mesh.face_areas[face]
    normal = mesh.face_normals[face]
    wa = np.einsum("nj,nj->n", np.cross(b - closest, c - closest), normal) / doubled
    wb = np.einsum("nj,nj->n", np.cross(c - closest, a - closest), normal) / doubled
    weights = np.stack([wa, wb, 1 - wa - wb], axis=1)
    smooth = np.einsum("nk,nkj->nj", weights, mesh.vertex_normals[corners])
    side = np.einsum("nj,nj->n", points - closest, smooth)
    return np.where(side < 0, -distance, distance)
