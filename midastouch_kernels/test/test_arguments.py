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


def test_scene_without_focal_length(grid):
    with pytest.raises(ValueError, match="focal length"):
        kernels.Scene(grid, np.ones((3, 3), np.float32), 0.0, GEL_DISTANCE, 0.0)
    with pytest.raises(TypeError):
        kernels.Scene(None, np.ones((3, 3), np.float32), FOCAL, GEL_DISTANCE, 0.0)


def test_normals_of_faces_that_are_not_there(scene, corners):
    faces = np.full((2, HEIGHT, WIDTH), len(corners), np.int32)
    tangent = np.zeros((HEIGHT, WIDTH))
    with pytest.raises(ValueError, match="not there"):
        kernels.interpolate_normals(scene, POSES, faces, corners, tangent, tangent)
    with pytest.raises(ValueError, match="every face"):
        kernels.interpolate_normals(scene, POSES, faces, corners[1:], tangent, tangent)


@pytest.mark.parametrize(
    ("corners", "cell", "message"),
    [
        (np.empty((0, 3, 3)), 1e-3, "at least one"),
        (np.eye(3)[None], 0.0, "size"),
        (np.eye(3)[None], np.nan, "size"),
        (np.eye(3)[None], 1e-9, "too small"),
        (np.full((1, 3, 3), np.inf), 1e-3, "non-finite"),
    ],
)
def test_grid(corners, cell, message):
    with pytest.raises(ValueError, match=message):
        kernels.TriangleGrid(corners, cell)


def test_farthest_points_of_what_is_not_finite():
    with pytest.raises(ValueError, match="not finite"):
        kernels.farthest_points(np.array([[0.0, np.nan]]), 1)
    with pytest.raises(TypeError):
        kernels.farthest_points(np.zeros((3, 2)), -1)


def test_neighbours_of_keys_out_of_order():
    with pytest.raises(ValueError, match="sorted"):
        kernels.neighbours(np.array([2, 1]), 5, 25, 1)
    with pytest.raises(ValueError, match="kernel"):
        kernels.neighbours(np.array([1, 2]), 5, 25, -1)


def test_colour_table_without_two_slopes():
    flat = np.zeros((4, 5), np.float32)
    with pytest.raises(ValueError, match="two slopes"):
        kernels.look_up_colours(np.zeros((1, 8, 6, 3), np.float32), flat, flat, 0, False)
    with pytest.raises(ValueError, match="different sizes"):
        kernels.look_up_colours(np.zeros((9, 8, 6, 3), np.float32), flat, flat[1:], 0, False)


def test_shade_of_different_sizes():
    depth, normals, lights = np.ones((4, 5), np.float32), np.ones((4, 5, 3), np.float32), np.ones((2, 3), np.float32)
    material = 1.0, 0.1, 0.1, 0.8
    assert kernels.shade(depth, normals, depth, depth, lights, lights, *material).shape == (4, 5, 3)
    with pytest.raises(ValueError, match="different sizes"):
        kernels.shade(depth, normals[:3], depth, depth, lights, lights, *material)
    with pytest.raises(ValueError, match="colour"):
        kernels.shade(depth, normals, depth, depth, lights, lights[:1], *material)


def test_canvas_of_different_sizes():
    heights, colours = np.zeros((6, 8)), np.zeros((6, 8, 3))
    with pytest.raises(ValueError, match="different sizes"):
        kernels.draw_discs(np.zeros((2, 2)), np.zeros(3), np.zeros((2, 3)), 1.0, 1.0, 1.0, heights, colours)
    with pytest.raises(ValueError, match="maps"):
        kernels.draw_triangles(np.zeros((1, 3, 2)), np.zeros((1, 3)), np.zeros((1, 3, 3)), heights[1:], colours)
    start = np.array([0, 1], np.int64)
    with pytest.raises(ValueError, match="no vertex"):
        kernels.corner_normals(np.int32([[0, 0, 1]]), np.ones((1, 3)), np.ones((1, 3)), start[:1], start, 0.7)


def test_means_over_blocks_that_do_not_fit():
    with pytest.raises(ValueError, match="odd"):
        kernels.halve_image(np.zeros((4, 5, 3), np.uint8))
    for rows, columns in ((3, 1), (1, 3), (0, 1), (1, 0)):
        with pytest.raises(ValueError, match="multiples"):
            kernels.block_means(np.zeros((4, 5), np.float32), rows, columns)


def test_background_and_sparse_pixels_of_another_size():
    image, background, sparse = (np.ones(shape, np.float32) for shape in ((8, 6, 3), (8, 5, 3), (2, 2, 3)))
    with pytest.raises(ValueError, match="different sizes"):
        kernels.change_beside_gain(image, background, sparse, 4, 0.1)
    for every in (0, 3):
        with pytest.raises(ValueError, match="every so many"):
            kernels.change_beside_gain(image, image, sparse, every, 0.1)


def test_threads():
    with pytest.raises(ValueError, match="negative"):
        kernels.set_threads(-1)
