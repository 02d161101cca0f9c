"""What alignment sees of a pose is what the renderer sees of it."""

from __future__ import annotations

import numpy as np
import pytest

import midastouch_kernels as kernels

from .sheet import FOCAL, GEL_DISTANCE, HEIGHT, WIDTH, poses_above

MARGIN = 1e-3  # m
PLACED = 1e-16 * np.eye(6)  # a prior so narrow that the pose stays where it is


@pytest.fixture
def fit_at(corners):
    """The fraction of a rendered map that alignment explains at the pose it was rendered at, once it came there."""
    # with a wall that goes through the camera's near plane
    wall = np.array([[[0.004, -0.02, -0.005], [0.004, 0.02, -0.005], [0.004, 0.0, 0.05]]])
    v, u = np.meshgrid(np.arange(HEIGHT), np.arange(WIDTH), indexing="ij")
    tangents = (u - (WIDTH - 1) / 2) / FOCAL, ((HEIGHT - 1) / 2 - v) / FOCAL

    def fit(pose: np.ndarray, walled: bool) -> float:
        grid = kernels.TriangleGrid(np.concatenate([corners, wall, wall[:, ::-1]]) if walled else corners, 2e-3)
        scene = kernels.Scene(
            grid, np.full((HEIGHT, WIDTH), GEL_DISTANCE + MARGIN, np.float32), FOCAL, GEL_DISTANCE, MARGIN
        )
        measured = np.zeros((1, HEIGHT, WIDTH), np.float32)
        kernels.render(scene, pose[None], measured, np.empty((1, 0, 0), np.int32))
        alignment = kernels.MapAlignment(scene, *tangents, np.full((HEIGHT, WIDTH), GEL_DISTANCE), 1e6, 22.5)
        start = pose.copy()
        start[0, 3] += 0.02  # far off: what is seen from there is not what is seen from the pose
        return alignment.align(pose, PLACED, measured[0] - np.float32(MARGIN), start)[3]

    return fit


@pytest.mark.parametrize("walled", [False, True])
def test_alignment_sees_what_the_renderer_sees(fit_at, walled):
    poses = poses_above(8)
    poses[:, 2, 3] = -0.5e-3
    # a pixel on an edge may fall to either side
    assert min(fit_at(pose, walled) for pose in poses) > 1 - 1e-4
