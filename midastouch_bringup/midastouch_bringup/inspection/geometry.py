"""Shapes and meshes as Open3D's geometry, and as files of it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh

from . import require_open3d
from .run import Run
from .shapes import Shape, shapes

MESH_COLOUR = (0.78, 0.78, 0.82)


def geometry_of(shape: Shape):
    """A PointCloud, or a LineSet whose lines have the colour of their first point."""
    o3d = require_open3d()
    points = o3d.utility.Vector3dVector(shape.points)
    if shape.lines is None:
        cloud = o3d.geometry.PointCloud(points)
        cloud.colors = o3d.utility.Vector3dVector(shape.colours)
        return cloud
    lines = o3d.geometry.LineSet(points, o3d.utility.Vector2iVector(shape.lines))
    lines.colors = o3d.utility.Vector3dVector(shape.colours[shape.lines[:, 0]])
    return lines


def mesh_geometry(mesh: ObjectMesh):
    """A TriangleMesh with normals at its vertices and of its faces: Open3D shades no mesh that lacks either."""
    o3d = require_open3d()
    out = o3d.geometry.TriangleMesh(o3d.utility.Vector3dVector(mesh.vertices), o3d.utility.Vector3iVector(mesh.faces))
    out.vertex_normals = o3d.utility.Vector3dVector(np.ascontiguousarray(mesh.vertex_normals))
    out.triangle_normals = o3d.utility.Vector3dVector(np.ascontiguousarray(mesh.face_normals))
    out.paint_uniform_color(MESH_COLOUR)
    return out


def export(run: Run, mesh: ObjectMesh, indices: Sequence[int], folder: Path, clouds: str) -> int:
    """Write `mesh.ply` and, for each of some moments, a folder named after it with its layers; returns how many files.

    clouds: "ply" or "pcd", the format of points; lines are PLY, PCD has none. Raises InputError if one cannot be
    written.
    """
    o3d = require_open3d()
    _written(o3d.io.write_triangle_mesh, folder / "mesh.ply", mesh_geometry(mesh))
    count = 1
    for index in indices:
        at = folder / f"{index:04d}"
        at.mkdir()
        for name, shape in shapes(run.moments, index).items():
            if shape.lines is None:
                _written(o3d.io.write_point_cloud, at / f"{name}.{clouds}", geometry_of(shape))
            else:
                _written(o3d.io.write_line_set, at / f"{name}.ply", geometry_of(shape))
            count += 1
    return count


def _written(write, path: Path, geometry) -> None:
    if not write(str(path), geometry):
        raise InputError(f"{path}: could not be written; is the disk full?")
