"""A finished run as files for other programs: mesh, clouds and lines in the object's frame, written by Open3D."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_common.pose_metric import pose_errors

from ..bags.run_record import RecordedMode
from ..drawing.object_view import ANGLE_COLOURS
from . import require_open3d
from .appearance import Trail, ellipsoids
from .finished_run import Moment, Run


def geometry_of(shape: Shape):
    """Return a PointCloud, or a LineSet whose lines have the colour of their first point."""
    o3d = require_open3d()
    points = o3d.utility.Vector3dVector(shape.points)
    if shape.lines is None:
        cloud = o3d.geometry.PointCloud(points)
        cloud.colors = o3d.utility.Vector3dVector(shape.colours)
        return cloud
    lines = o3d.geometry.LineSet(points, o3d.utility.Vector2iVector(shape.lines))
    lines.colors = o3d.utility.Vector3dVector(shape.colours[shape.lines[:, 0]])
    return lines


def export(run: Run, mesh: ObjectMesh, folder: Path) -> int:
    """Write `mesh.ply` and, for each moment, a folder named after it with its layers as PLY; returns the file count.

    Raises InputError if a file cannot be written.
    """
    o3d = require_open3d()
    vertices, faces = o3d.utility.Vector3dVector(mesh.vertices), o3d.utility.Vector3iVector(mesh.faces)
    _written(o3d.io.write_triangle_mesh, folder / "mesh.ply", o3d.geometry.TriangleMesh(vertices, faces))
    count = 1
    for index in range(len(run.moments)):
        at = folder / f"{index:04d}"
        at.mkdir()
        for name, shape in shapes(run.moments, index).items():
            write = o3d.io.write_point_cloud if shape.lines is None else o3d.io.write_line_set
            _written(write, at / f"{name}.ply", geometry_of(shape))
            count += 1
    return count


def _written(write, path: Path, geometry) -> None:
    if not write(str(path), geometry):
        raise InputError(f"{path}: could not be written; is the disk full?")


_PARTICLE, _MODE, _CONTACT = (0.9, 0.45, 0.1), (0.15, 0.15, 0.15), (0.85, 0.1, 0.65)
_ESTIMATE, _TRUTH = (0.85, 0.1, 0.2), (0.05, 0.55, 0.25)
_AXIS = 0.012  # m
_RING = 48  # points
_MOST_MODES = 6


@dataclasses.dataclass(frozen=True)
class Shape:
    """Points (P, 3) m with colours (P, 3) in [0, 1]; lines (L, 2): indices of points, None for points alone."""

    points: np.ndarray
    colours: np.ndarray
    lines: np.ndarray | None = None


def shapes(moments: list[Moment], index: int) -> dict[str, Shape]:
    """Return the layers at a moment that are not empty, by name: particles, modes as two-sigma ellipsoids with the
    gel's axes, the measured contact, and the paths so far of the estimates and of the truth."""
    now, past = moments[index], moments[: index + 1]
    trials = range(len(now.estimates))
    layers = {
        "particles": _cloud(now.particles[:, :3, 3], _particle_colours(now)),
        "modes": _joined([line for mode in now.modes[:_MOST_MODES] for line in _mode_lines(mode)]),
        "contact": _cloud(now.contact, np.tile(_CONTACT, (len(now.contact), 1))),
        "estimate": _joined([line for k in trials for line in _path([m.estimates[k] for m in past], _ESTIMATE)]),
        "truth": _joined(_path([m.truth for m in past], _TRUTH)),
    }
    return {name: shape for name, shape in layers.items() if len(shape.points)}


def _particle_colours(moment: Moment) -> np.ndarray:
    """Colour particles blue to red by their angle to the truth, as in the demo's pictures; alike without a truth."""
    if moment.truth is None or not len(moment.particles):
        return np.tile(_PARTICLE, (len(moment.particles), 1))
    angle = pose_errors(moment.particles, moment.truth)[1]
    return ANGLE_COLOURS(0.1 + 0.8 * angle / np.pi)[:, :3]


def _mode_lines(mode: RecordedMode) -> list[Shape]:
    half, quaternions = ellipsoids(mode.covariance[None, :3, :3])
    turn = np.linspace(0, 2 * np.pi, _RING)
    flat = np.stack([np.cos(turn), np.sin(turn), np.zeros(_RING)], axis=1)
    placed = se3.from_xyzquat(np.concatenate([mode.pose[:3, 3], quaternions[0]]))
    rings = [_line(half[0] * np.roll(flat, k, axis=1) @ placed[:3, :3].T + placed[:3, 3], _MODE) for k in range(3)]
    return rings + _axes(mode.pose)


def _axes(pose: np.ndarray) -> list[Shape]:
    """The gel's x, y and z as red, green and blue lines."""
    tips = pose[:3, 3] + _AXIS * pose[:3, :3].T
    return [_line(np.stack([pose[:3, 3], tip]), colour) for tip, colour in zip(tips, np.eye(3) * 0.8, strict=True)]


def _path(poses: list[np.ndarray | None], colour: tuple[float, float, float]) -> list[Shape]:
    """Return the lines that a pose has followed, and the axes of the last pose."""
    trail = Trail(length=len(poses))
    for pose in poses:
        if pose is not None:
            trail.add(pose[:3, 3])
    lines = [_line(strip, colour) for strip in trail.strips]
    return lines if poses[-1] is None else lines + _axes(poses[-1])


def _cloud(points: np.ndarray, colours: np.ndarray) -> Shape:
    return Shape(np.asarray(points, float).reshape(-1, 3), np.asarray(colours, float).reshape(-1, 3))


def _line(points: np.ndarray, colour: np.ndarray | tuple[float, float, float]) -> Shape:
    steps = np.arange(len(points) - 1)
    return Shape(points, np.tile(colour, (len(points), 1)), np.stack([steps, steps + 1], axis=1))


def _joined(lines: list[Shape]) -> Shape:
    """Join lines into one shape."""
    if not lines:
        return Shape(np.empty((0, 3)), np.empty((0, 3)), np.empty((0, 2), int))
    starts = np.cumsum([0, *(len(line.points) for line in lines[:-1])])
    indices = [line.lines + start for line, start in zip(lines, starts, strict=True)]
    return Shape(
        np.concatenate([line.points for line in lines]),
        np.concatenate([line.colours for line in lines]),
        np.concatenate(indices),
    )
