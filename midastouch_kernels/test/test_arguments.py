"""What does not fit is refused before anything is read or written."""

from __future__ import annotations

import numpy as np
import pytest

import midastouch_kernels as kernels

from .sheet import FOCAL, GEL_DISTANCE, HEIGHT, WIDTH

POSES = np.tile(np.eye(4), (2, 1, 1))
NOBODY_ASKS = np.empty((2, 0, 0), np.int32)


def maps(dtype=np.float32, shape=(2, HEIGHT, WIDTH)):
    return np.zeros(shape, dtype)


@pytest.mark.parametrize(
    ("poses", "penetration"),
    [
        (POSES.astype(np.float32), maps()),
        (POSES, maps(np.float64)),
        (POSES.tolist(), maps()),
        (POSES[:, :3], maps()),
        (POSES[0], maps()),
        (POSES.transpose(0, 2, 1), maps()),
        (POSES, maps(shape=(2, HEIGHT, 2 * WIDTH))[..., ::2]),
        (POSES, np.asfortranarray(maps())),
    ],
    ids=["single", "double", "list", "shape", "dimensions", "transposed", "strided", "Fortran order"],
)
def test_type_and_layout(scene, poses, penetration):
    with pytest.raises(TypeError, match="incompatible function arguments"):
        kernels.render(scene, poses, penetration, NOBODY_ASKS)


def test_read_only_output(scene):
    penetration = maps()
    penetration.flags.writeable = False
    with pytest.raises(TypeError):
        kernels.render(scene, POSES, penetration, NOBODY_ASKS)


@pytest.mark.parametrize("shape", [(1, HEIGHT, WIDTH), (2, HEIGHT, WIDTH - 1), (3, HEIGHT, WIDTH)])
def test_render_into_maps_of_another_size(scene, shape):
    with pytest.raises(ValueError, match="map for each pose"):
        kernels.render(scene, POSES, maps(shape=shape), NOBODY_ASKS)
    with pytest.raises(ValueError, match="map for each pose"):
        kernels.render(scene, POSES, maps(), maps(np.int32, shape))


def test_normals_of_faces_that_are_not_there(scene, corners):
    faces = np.full((2, HEIGHT, WIDTH), len(corners), np.int32)
    tangent = np.zeros((HEIGHT, WIDTH))
    with pytest.raises(ValueError, match="not there"):
        kernels.interpolate_normals(scene, POSES, faces, corners, tangent, tangent)
    with pytest.raises(ValueError, match="every face"):
        kernels.interpolate_normals(scene, POSES, faces, corners[1:], tangent, tangent)


def ones(*shape: int) -> np.ndarray:
    return np.ones(shape, np.float32)


ODD = np.full((1, 3, 3), np.inf)
DEPTH, LIGHTS, MATERIAL = ones(4, 5), ones(2, 3), (1.0, 0.1, 0.1, 0.8)
FACE = np.int32([[0, 0, 1]]), np.ones((1, 3)), np.ones((1, 3))
HEIGHTS, START = np.zeros((6, 8)), np.array([0, 1], np.int64)
DISCS, TRIANGLE = (np.zeros((2, 2)), np.zeros(3), np.zeros((2, 3))), (np.zeros((1, 3, 2)), np.zeros((1, 3)), ODD)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda grid: kernels.Scene(grid, ones(3, 3), 0.0, GEL_DISTANCE, 0.0), "focal length"),
        (lambda _: kernels.Scene(None, ones(3, 3), FOCAL, GEL_DISTANCE, 0.0), "incompatible"),
        (lambda _: kernels.TriangleGrid(np.empty((0, 3, 3)), 1e-3), "at least one"),
        (lambda _: kernels.TriangleGrid(np.eye(3)[None], 0.0), "size"),
        (lambda _: kernels.TriangleGrid(np.eye(3)[None], np.nan), "size"),
        (lambda _: kernels.TriangleGrid(np.eye(3)[None], 1e-9), "too small"),
        (lambda _: kernels.TriangleGrid(ODD, 1e-3), "non-finite"),
        (lambda _: kernels.farthest_points(np.array([[0.0, np.nan]]), 1), "not finite"),
        (lambda _: kernels.farthest_points(np.zeros((3, 2)), -1), "incompatible"),
        (lambda _: kernels.neighbours(np.array([2, 1]), 5, 25, 1), "sorted"),
        (lambda _: kernels.neighbours(np.array([1, 2]), 5, 25, -1), "kernel"),
        (lambda _: kernels.look_up_colours(ones(1, 8, 6, 3), DEPTH, DEPTH, 0, False), "two slopes"),
        (lambda _: kernels.look_up_colours(ones(9, 8, 6, 3), DEPTH, DEPTH[1:], 0, False), "different sizes"),
        (lambda _: kernels.shade(DEPTH, ones(3, 5, 3), DEPTH, DEPTH, LIGHTS, LIGHTS, *MATERIAL), "different sizes"),
        (lambda _: kernels.shade(DEPTH, ones(4, 5, 3), DEPTH, DEPTH, LIGHTS, LIGHTS[:1], *MATERIAL), "colour"),
        (lambda _: kernels.draw_discs(*DISCS, 1.0, 1.0, 1.0, HEIGHTS, np.zeros((6, 8, 3))), "different sizes"),
        (lambda _: kernels.draw_triangles(*TRIANGLE, HEIGHTS[1:], np.zeros((6, 8, 3))), "maps"),
        (lambda _: kernels.corner_normals(*FACE, START[:1], START, 0.7), "no vertex"),
        (lambda _: kernels.halve_image(np.zeros((4, 5, 3), np.uint8)), "odd"),
        *((lambda _, by=by: kernels.block_means(DEPTH, *by), "multiples") for by in ((3, 1), (1, 3), (0, 1), (1, 0))),
        (lambda _: kernels.change_beside_gain(ones(8, 6, 3), ones(8, 5, 3), ones(2, 2, 3), 4, 0.1), "different sizes"),
        (lambda _: kernels.change_beside_gain(ones(8, 6, 3), ones(8, 6, 3), ones(2, 2, 3), 0, 0.1), "every so many"),
        (lambda _: kernels.change_beside_gain(ones(8, 6, 3), ones(8, 6, 3), ones(2, 2, 3), 3, 0.1), "every so many"),
        (lambda _: kernels.set_threads(-1), "negative"),
    ],
)
def test_what_does_not_fit_is_refused(grid, call, message):
    with pytest.raises((ValueError, TypeError), match=message):
        call(grid)
