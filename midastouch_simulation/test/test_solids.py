import numpy as np
import pytest
import trimesh

from midastouch_simulation.solids import Layer, circle, lofted, mirrored, rectangle, repeated, stacked


def solid(mesh) -> trimesh.Trimesh:
    made = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    assert made.is_watertight
    assert made.is_winding_consistent
    return made


def test_outlines_may_cross_and_cuts_reach_out_of_them():
    cross = rectangle(0.06, 0.02), rectangle(0.02, 0.06)
    notch = rectangle(0.02, 0.004, x=0.03)
    mesh = solid(stacked([Layer(0.01, cross, (notch,))], "cross"))
    assert mesh.volume == pytest.approx(0.01 * (2 * 0.06 * 0.02 - 0.02**2 - 0.01 * 0.004))


def test_layers_of_different_outlines_are_joined():
    bore = circle(0.005)
    mesh = solid(
        stacked([Layer(0.01, (rectangle(0.06, 0.04),), (bore,)), Layer(0.02, (circle(0.015),), (bore,))], "hub")
    )
    area = [96 / 2 * np.sin(2 * np.pi / 96) * radius**2 for radius in (0.005, 0.015)]
    assert mesh.volume == pytest.approx(0.01 * (0.06 * 0.04 - area[0]) + 0.02 * (area[1] - area[0]))
    assert mesh.euler_number == 0  # one hole through it
    np.testing.assert_allclose(mesh.bounds[:, 2], [-0.015, 0.015])


def test_walls_may_lie_in_one_plane_or_cross_at_any_angle():
    step = rectangle(0.01, 0.04, x=-0.025)
    mesh = solid(stacked([Layer(0.01, (rectangle(0.06, 0.04),)), Layer(0.01, (step,))], "step"))
    assert mesh.volume == pytest.approx(0.01 * 0.04 * (0.06 + 0.01))

    for tilt in (1e-3, 1e-5, 1e-7):
        tilted = np.array([[-0.03, -0.02 - tilt], [0.03, -0.02 + tilt], [0.02, 0.01], [-0.02, 0.015]])
        solid(stacked([Layer(0.01, (rectangle(0.06, 0.04), tilted))], "tilted"))


@pytest.mark.parametrize("beyond", [0.6e-8, 0.9e-8, 1.5e-8])
@pytest.mark.parametrize("tilt", [0.1, 0.6])
def test_a_wall_may_almost_meet_a_corner(beyond, tilt):
    roof = np.array([[-0.01, 0.0], [0.01, 0.0], [0.0, 0.02]])
    turn = np.array([[np.cos(tilt), -np.sin(tilt)], [np.sin(tilt), np.cos(tilt)]])
    wall = np.array([[-0.03, 0.0], [0.03, 0.0], [0.0, -0.03]]) @ turn + [0.01 - beyond, 0.0]
    solid(stacked([Layer(0.01, (roof, wall))], "almost"))


def test_rings_are_joined_and_closed():
    rings = [np.column_stack([circle(radius, sides=64), np.full(64, z)]) for radius, z in ((0.02, 0.0), (0.01, 0.03))]
    cone = solid(lofted(rings, "cone"))
    base = 64 / 2 * np.sin(2 * np.pi / 64)
    assert cone.volume == pytest.approx(base * 0.03 / 3 * (0.02**2 + 0.02 * 0.01 + 0.01**2))


def test_a_mirrored_stack_is_the_mirror_image():
    layers = [
        Layer(0.01, (rectangle(0.06, 0.04), rectangle(0.02, 0.02, 0.02, 0.03))),
        Layer(0.01, (rectangle(0.01, 0.01),)),
    ]
    image = stacked(mirrored(layers), "image")
    points, _, _ = stacked(layers, "own").sample_surface(500, np.random.default_rng(0))
    assert solid(image).volume > 0
    assert image.closest_points(points * [-1, 1, 1])[1].max() < 1e-9
    assert image.closest_points(points)[1].max() > 1e-3


def test_repeated_outlines_lie_on_a_circle():
    holes = repeated(circle(0.002, 0.02, sides=12), 3)
    middles = np.array([hole.mean(axis=0) for hole in holes])
    np.testing.assert_allclose(np.linalg.norm(middles, axis=1), 0.02)
    np.testing.assert_allclose(middles.sum(axis=0), 0, atol=1e-12)
