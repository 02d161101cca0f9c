"""Penetration maps of a mesh pressed into the gel, for batches of contact poses.

A z-buffer over only the triangles under the sensor's footprint, rasterised in homogeneous coordinates (Olano and
Greer 1997): no clipping is needed, and the depth at a pixel centre is exact. Back faces are culled, as TACTO does.
"""

from __future__ import annotations

from functools import cached_property

import numba
import numpy as np

from ..mesh import ObjectMesh
from ..sensor_model import SensorModel
from ..triangle_grid import TriangleGrid

_NEAR = 1e-3  # m, the camera's near plane
_WORTH_THREADS = 8  # poses; fewer are drawn sooner than threads are woken


class PenetrationRenderer:
    """Renders one mesh for one sensor model.

    Args: mesh; sensor, whose width x height is the size of the maps (see `SensorModel.scaled`); margin [m]: surface
    up to this far below the undeformed gel is seen too, as negative penetration down to -margin. Pose alignment needs
    it to know what is about to touch.
    """

    def __init__(self, mesh: ObjectMesh, sensor: SensorModel, margin: float = 0.0):
        self.mesh, self.sensor, self.margin = mesh, sensor, margin
        cell = float(np.clip(mesh.diagonal / 40, 2e-3, 8e-3))
        self._grid = TriangleGrid(mesh.vertices[mesh.faces], cell)
        self._gel_depth = np.ascontiguousarray(sensor.gel_depth + margin, np.float32)

    @property
    def scene(self) -> tuple:
        """Object and sensor as `draw_share` takes them."""
        grid, sensor = self._grid, self.sensor
        return (
            grid.corners, grid.origin, grid.cell, grid.shape, grid.start, grid.items,
            self._gel_depth, sensor.focal, sensor.gel_distance, self.margin,
        )  # fmt: skip

    def render(self, poses: np.ndarray) -> np.ndarray:
        """Penetration maps (N, H, W) float32 [m] at gel poses `T_obj_gel` (N, 4, 4).

        Penetration is the undeformed gel's depth minus the surface's along the camera axis, `-margin` (0) where there
        is nothing.
        """
        penetration = self._rasterise(poses, False)[0]
        if self.margin:
            penetration -= np.float32(self.margin)
        return penetration

    def render_with_normals(self, poses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Penetration (N, H, W) float32 [m] and smooth-shaded normals (N, H, W, 3) float32 in the gel frame.

        Normals interpolate the mesh's vertex normals; where there is no contact they are 0.
        """
        poses = np.ascontiguousarray(poses, float)
        penetration, faces = self._rasterise(poses, True)
        tangent_x, tangent_y = self.sensor.rays
        normals = _interpolate_normals(
            poses,
            penetration,
            faces,
            self._gel_depth,
            self._grid.corners,
            self._corner_normals,
            tangent_x,
            tangent_y,
            self.sensor.gel_distance,
        )
        return penetration, normals

    @cached_property
    def _corner_normals(self) -> np.ndarray:
        return self.mesh.vertex_normals[self.mesh.faces]

    def _rasterise(self, poses: np.ndarray, with_faces: bool) -> tuple[np.ndarray, np.ndarray]:
        poses = np.ascontiguousarray(poses, float)
        if poses.ndim != 3 or poses.shape[1:] != (4, 4):
            raise ValueError(f"poses must be (N, 4, 4), got {poses.shape}")
        penetration = np.zeros((len(poses), self.sensor.height, self.sensor.width), np.float32)
        faces = np.full(penetration.shape if with_faces else (len(poses), 0, 0), -1, np.int32)
        arguments = (poses, *self.scene, with_faces, penetration, faces)
        if len(poses) < _WORTH_THREADS:
            draw_share(0, 1, *arguments)
        else:
            _rasterise(numba.get_num_threads(), *arguments)
        return penetration, faces


@numba.njit(cache=True, parallel=True)
def _rasterise(
    n_threads, poses, corners, origin, cell, shape, start, items, gel_depth, focal, distance, margin, with_faces,
    penetration, faces,
):  # fmt: skip
    for thread in numba.prange(n_threads):
        draw_share(
            thread, n_threads, poses, corners, origin, cell, shape, start, items, gel_depth, focal, distance, margin,
            with_faces, penetration, faces,
        )  # fmt: skip


@numba.njit(cache=True, nogil=True)
def draw_share(
    first, step, poses, corners, origin, cell, shape, start, items, gel_depth, focal, distance, margin, with_faces,
    penetration, faces,
):  # fmt: skip
    """Render every `step`-th pose from `first` on into `penetration` (N, H, W) float32, which holds zeros, plus margin.

    For kernels of others: `PenetrationRenderer.scene` holds the arguments between `poses` and `with_faces`.
    """
    height, width = gel_depth.shape
    # the view frustum down to `margin` below the gel, as a box in the gel frame
    deepest = distance + margin
    half_x, half_y, half_z = 0.5 * width / focal * deepest, 0.5 * height / focal * deepest, 0.5 * deepest
    middle_z = 0.5 * (distance - margin)
    slack = 0.8661 * cell
    seen = np.full(corners.shape[0], -1, np.int32)
    q = np.empty((3, 3))
    edge = np.empty((3, 3))
    low, high = np.empty(3, np.int64), np.empty(3, np.int64)
    for i in range(first, poses.shape[0], step):
        rotation, translation = poses[i, :3, :3], poses[i, :3, 3]
        for k in range(3):
            centre = translation[k] + rotation[k, 2] * middle_z
            reach = abs(rotation[k, 0]) * half_x + abs(rotation[k, 1]) * half_y + abs(rotation[k, 2]) * half_z
            low[k] = max(int(np.floor((centre - reach - origin[k]) / cell)), 0)
            high[k] = min(int(np.floor((centre + reach - origin[k]) / cell)), shape[k] - 1)
        for x in range(low[0], high[0] + 1):
            dx = origin[0] + (x + 0.5) * cell - translation[0]
            for y in range(low[1], high[1] + 1):
                dy = origin[1] + (y + 0.5) * cell - translation[1]
                for z in range(low[2], high[2] + 1):
                    dz = origin[2] + (z + 0.5) * cell - translation[2]
                    c = (x * shape[1] + y) * shape[2] + z
                    if start[c] == start[c + 1]:
                        continue
                    if abs(rotation[0, 0] * dx + rotation[1, 0] * dy + rotation[2, 0] * dz) > half_x + slack:
                        continue
                    if abs(rotation[0, 1] * dx + rotation[1, 1] * dy + rotation[2, 1] * dz) > half_y + slack:
                        continue
                    up = rotation[0, 2] * dx + rotation[1, 2] * dy + rotation[2, 2] * dz
                    if abs(up - middle_z) > half_z + slack:
                        continue
                    for j in range(start[c], start[c + 1]):
                        f = items[j]
                        if seen[f] == i:
                            continue
                        seen[f] = i
                        _draw(
                            f, corners[f], rotation, translation, gel_depth, focal, distance, deepest, q, edge,
                            with_faces, penetration[i], faces[i],
                        )  # fmt: skip


@numba.njit(cache=True)
def _to_camera(corners, rotation, translation, distance, q):
    """Corners in camera coordinates (x right, y up, depth forward) into q; returns the smallest depth."""
    nearest = np.inf
    for k in range(3):
        dx = corners[k, 0] - translation[0]
        dy = corners[k, 1] - translation[1]
        dz = corners[k, 2] - translation[2]
        q[k, 0] = rotation[0, 0] * dx + rotation[1, 0] * dy + rotation[2, 0] * dz
        q[k, 1] = rotation[0, 1] * dx + rotation[1, 1] * dy + rotation[2, 1] * dz
        q[k, 2] = distance - (rotation[0, 2] * dx + rotation[1, 2] * dy + rotation[2, 2] * dz)
        nearest = min(nearest, q[k, 2])
    return nearest


@numba.njit(cache=True)
def _edges(q, edge):
    """Edge functions: edge[k] . (tx, ty, 1) >= 0 inside a front-facing triangle; returns det(q)."""
    for k in range(3):
        a, b = (k + 1) % 3, (k + 2) % 3
        edge[k, 0] = q[a, 1] * q[b, 2] - q[a, 2] * q[b, 1]
        edge[k, 1] = q[a, 2] * q[b, 0] - q[a, 0] * q[b, 2]
        edge[k, 2] = q[a, 0] * q[b, 1] - q[a, 1] * q[b, 0]
    return q[0, 0] * edge[0, 0] + q[0, 1] * edge[0, 1] + q[0, 2] * edge[0, 2]


@numba.njit(cache=True, error_model="numpy")
def _draw(
    f, corners, rotation, translation, gel_depth, focal, distance, deepest, q, edge, with_faces, penetration, faces
):
    nearest = _to_camera(corners, rotation, translation, distance, q)
    if nearest >= deepest:  # below the gel's apex plane: out of view
        return
    height, width = gel_depth.shape
    left, right, top, bottom = 0, width - 1, 0, height - 1
    if nearest > _NEAR:
        u_min = v_min = np.inf
        u_max = v_max = -np.inf
        for k in range(3):
            u = q[k, 0] / q[k, 2] * focal + 0.5 * width - 0.5
            v = -q[k, 1] / q[k, 2] * focal + 0.5 * height - 0.5
            u_min, u_max, v_min, v_max = min(u_min, u), max(u_max, u), min(v_min, v), max(v_max, v)
        if u_max < left or v_max < top or u_min > right or v_min > bottom:
            return
        left, right = max(left, int(np.floor(u_min))), min(right, int(np.ceil(u_max)))
        top, bottom = max(top, int(np.floor(v_min))), min(bottom, int(np.ceil(v_max)))
    determinant = _edges(q, edge)
    if determinant <= 0.0:  # seen from behind, or edge-on
        return
    # each row's span where all three edge functions, linear in the column, are not negative
    step = 1.0 / focal
    for v in range(top, bottom + 1):
        ty = -(v + 0.5 - 0.5 * height) * step
        first, last = float(left), float(right)
        for k in range(3):
            slope = edge[k, 0] * step
            value = edge[k, 1] * ty + edge[k, 2] + edge[k, 0] * (0.5 - 0.5 * width) * step
            if slope > 0.0:
                first = max(first, -value / slope - 1e-9)
            elif slope < 0.0:
                last = min(last, -value / slope + 1e-9)
            elif value < 0.0:
                last = -1.0
        if last < first:
            continue
        # 1 / depth is linear in the column
        slope = (edge[0, 0] + edge[1, 0] + edge[2, 0]) * step / determinant
        at_zero = (
            (edge[0, 1] + edge[1, 1] + edge[2, 1]) * ty
            + (edge[0, 2] + edge[1, 2] + edge[2, 2])
            + (edge[0, 0] + edge[1, 0] + edge[2, 0]) * (0.5 - 0.5 * width) * step
        ) / determinant
        row, gel = penetration[v], gel_depth[v]
        begin, end = int(np.ceil(first)), int(np.floor(last)) + 1
        if with_faces:
            for u in range(begin, end):
                depth = 1.0 / (at_zero + slope * u)
                sunk = np.float32(gel[u] - depth)
                if depth > _NEAR and sunk > row[u]:
                    row[u] = sunk
                    faces[v, u] = f
        else:
            for u in range(begin, end):
                depth = 1.0 / (at_zero + slope * u)
                sunk = np.float32(gel[u] - depth)
                row[u] = sunk if depth > _NEAR and sunk > row[u] else row[u]


@numba.njit(cache=True, parallel=True)
def _interpolate_normals(poses, penetration, faces, gel_depth, corners, corner_normals, tangent_x, tangent_y, distance):
    n, height, width = penetration.shape
    normals = np.zeros((n, height, width, 3), np.float32)
    for i in numba.prange(n):
        rotation, translation = poses[i, :3, :3], poses[i, :3, 3]
        q, edge, local = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
        weight = np.empty(3)
        current = -1
        for v in range(height):
            for u in range(width):
                f = faces[i, v, u]
                if f < 0:
                    continue
                if f != current:
                    current = f
                    _to_camera(corners[f], rotation, translation, distance, q)
                    _edges(q, edge)
                    for a in range(3):
                        for b in range(3):
                            local[a, b] = (
                                corner_normals[f, a, 0] * rotation[0, b]
                                + corner_normals[f, a, 1] * rotation[1, b]
                                + corner_normals[f, a, 2] * rotation[2, b]
                            )
                for k in range(3):
                    weight[k] = edge[k, 0] * tangent_x[v, u] + edge[k, 1] * tangent_y[v, u] + edge[k, 2]
                for k in range(3):
                    normals[i, v, u, k] = weight[0] * local[0, k] + weight[1] * local[1, k] + weight[2] * local[2, k]
                length = np.sqrt(normals[i, v, u, 0] ** 2 + normals[i, v, u, 1] ** 2 + normals[i, v, u, 2] ** 2)
                for k in range(3):
                    normals[i, v, u, k] /= max(length, 1e-20)
    return normals
