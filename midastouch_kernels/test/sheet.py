"""A small bumpy sheet, poses that look at it, and what a build of the kernels makes of them.

As a script: `sheet.py BUILD FILE` writes the results of one build into an .npz file.
"""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import numpy as np

GEL_DISTANCE = 0.02  # m
FOCAL = 60.0  # pixels
HEIGHT, WIDTH = 40, 30


def bumpy_corners() -> np.ndarray:
    """Triangles (F, 3, 3) of a sheet of 60 x 60 mm with bumps of 1 mm, seen from above."""
    x, y = np.meshgrid(np.linspace(-0.03, 0.03, 41), np.linspace(-0.03, 0.03, 41), indexing="ij")
    z = 1e-3 * np.sin(400 * x) * np.cos(300 * y)
    points = np.stack([x, y, z], axis=-1)
    a, b, c, d = points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]
    return np.concatenate([np.stack([a, b, c], axis=2), np.stack([a, c, d], axis=2)]).reshape(-1, 3, 3)


def poses_above(n: int) -> np.ndarray:
    """Gel poses (n, 4, 4) around the sheet's middle, turned about its normal."""
    rng = np.random.default_rng(0)
    poses = np.tile(np.eye(4), (n, 1, 1))
    yaw = rng.uniform(0, 2 * np.pi, n)
    poses[:, 0, 0] = poses[:, 1, 1] = np.cos(yaw)
    poses[:, 1, 0], poses[:, 0, 1] = np.sin(yaw), -np.sin(yaw)
    poses[:, :2, 3] = rng.uniform(-0.01, 0.01, (n, 2))
    return poses


def results(module) -> dict[str, np.ndarray]:
    """What the batched kernels of a module make of the same input."""
    rng = np.random.default_rng(5)
    corners, poses = bumpy_corners(), poses_above(40)
    grid = module.TriangleGrid(corners, 2e-3)
    gel_depth = np.full((HEIGHT, WIDTH), GEL_DISTANCE, np.float32)
    scene = module.Scene(grid, gel_depth, FOCAL, GEL_DISTANCE, 1e-3)
    penetration = np.zeros((len(poses), HEIGHT, WIDTH), np.float32)
    faces = np.full(penetration.shape, -1, np.int32)
    module.render(scene, poses, penetration, faces)
    tangent = np.tile(np.linspace(-0.3, 0.3, WIDTH), (HEIGHT, 1))
    normals = module.interpolate_normals(scene, poses, faces, corners, tangent, tangent)
    points = 0.01 * rng.standard_normal((500, 3))
    slopes = rng.standard_normal((2, HEIGHT, WIDTH)).astype(np.float32)
    table = rng.standard_normal((9, 8, 6, 3)).astype(np.float32)
    lights = rng.standard_normal((3, 3)).astype(np.float32)
    rays = tangent.astype(np.float32)
    return {
        "moved": np.hstack(drawn(module, 7, 1000)),
        "aligned": aligned(module, scene, poses[0], penetration[0] - np.float32(1e-3), gel_depth, tangent),
        "penetration": penetration,
        "normals": normals,
        "farthest": module.farthest_points(points, 100),
        "colours": module.look_up_colours(table, *slopes, 1, True) / 640**2,
        "shade": module.shade(gel_depth, normals[0], rays, rays, lights, abs(lights), 1.0, 0.1, 0.1, 0.8),
        "neighbours": module.neighbours(np.unique(rng.integers(0, 900, 300)), 10, 100, 1),
    }


def assert_same(found, expected: dict[str, np.ndarray]) -> None:
    """What `results` gave elsewhere is what it gives here, but for rounding: to 1e-5 of the largest value."""
    for key, value in expected.items():
        wrong = np.abs(found[key] - value) > 1e-5 * np.abs(value).max()
        # rounding decides which of two triangles a pixel on their common edge shows
        assert wrong.mean() < 1e-3, f"{key}: {wrong.sum()} of {wrong.size}"


def drawn(module, seed: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Positions and quaternions of particles at rest that were moved by noise."""
    positions, quaternions = np.zeros((count, 3), np.float32), np.tile(np.float32([0, 0, 0, 1]), (count, 1))
    step = np.float32([0, 0, 0, 0, 0, 0, 1])
    module.compose(0, count, positions, quaternions, step, np.full(6, 1e-3, np.float32), module.NormalStream(seed))
    return positions, quaternions


def aligned(module, scene, pose, measured, gel_depth, tangent) -> np.ndarray:
    """The pose that a map measured at `pose` leads to from 1 mm beside."""
    alignment = module.MapAlignment(scene, tangent, tangent, gel_depth.astype(float), 1e6, 22.5)
    start = pose.copy()
    start[0, 3] += 1e-3
    return alignment.align(pose, 1e-6 * np.eye(6), measured, start)[0]


def load(name: str):
    """A build of the kernels by itself: two in one process would share their classes."""
    folder = importlib.util.find_spec("midastouch_kernels").submodule_search_locations[0]
    (path,) = Path(folder).glob(f"{name}.*.so")
    spec = importlib.util.spec_from_file_location(name, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


if __name__ == "__main__":
    np.savez(sys.argv[2], **results(load(sys.argv[1])))
