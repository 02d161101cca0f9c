import numpy as np
import pytest

from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh
from midastouch_perception.rendering.contact_poses import sample_contact_poses
from midastouch_perception.rendering.renderer import PenetrationRenderer, sunk_in
from midastouch_simulation.procedural import box, mesh_from_sdf

REACH = 0.5e-3


def ray_cast(mesh, pose, sensor):
    """Penetration by intersecting every pixel's ray with every front-facing triangle (Moeller and Trumbore 1997)."""
    tangent_x, tangent_y = (t.ravel() for t in sensor.rays)
    camera = pose @ se3.translation([0, 0, sensor.gel_distance])
    directions = np.stack([tangent_x, tangent_y, -np.ones_like(tangent_x)], axis=1) @ camera[:3, :3].T
    depth = sensor.gel_depth.ravel().copy()
    for a, b, c in mesh.vertices[mesh.faces]:
        e1, e2 = b - a, c - a
        p = np.cross(directions, e2)
        determinant = p @ e1
        with np.errstate(divide="ignore", invalid="ignore"):
            s = camera[:3, 3] - a
            u = p @ s / determinant
            q = np.cross(s, e1)
            v = directions @ q / determinant
            t = e2 @ q / determinant
        hit = (determinant > 0) & (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 1e-3)
        depth[hit] = np.minimum(depth[hit], t[hit])
    return (sensor.gel_depth.ravel() - depth).reshape(sensor.height, sensor.width)


@pytest.fixture(scope="module")
def coarse_block():
    """A box of few faces: each costs brute force an intersection test per ray."""
    return mesh_from_sdf(box((0.016, 0.012, 0.008), 0.003), np.array([0.019, 0.015, 0.011]), 2e-3, "coarse_block")


def fin(mesh):
    """The mesh with a third triangle on every 50th face's first edge, standing off by 2 mm: not a manifold."""
    chosen = mesh.faces[::50]
    tips = mesh.vertices[chosen[:, 0]] + 2e-3 * mesh.vertex_normals[chosen[:, 0]]
    third = len(mesh.vertices) + np.arange(len(chosen))
    fins = np.column_stack([chosen[:, 0], chosen[:, 1], third])
    return np.concatenate([mesh.vertices, tips]), np.concatenate([mesh.faces, fins])


@pytest.mark.parametrize(
    "variant", ["as it is", "inverted", "a face missing", "a face doubled", "without area", "fins", "half inverted"]
)
def test_equals_brute_force_ray_casting(coarse_block, sensor, variant):
    half_inverted = coarse_block.faces.copy()
    half_inverted[::2] = half_inverted[::2, ::-1]
    vertices, faces = {
        "as it is": (coarse_block.vertices, coarse_block.faces),
        "inverted": (coarse_block.vertices, coarse_block.faces[:, ::-1]),
        "a face missing": (coarse_block.vertices, coarse_block.faces[1:]),
        "a face doubled": (coarse_block.vertices, np.concatenate([coarse_block.faces, coarse_block.faces[:40]])),
        "without area": (
            coarse_block.vertices,
            np.concatenate([coarse_block.faces, coarse_block.faces[:40, [0, 1, 1]]]),
        ),
        "fins": fin(coarse_block),
        "half inverted": (coarse_block.vertices, half_inverted),
    }[variant]
    mesh = ObjectMesh.from_arrays(vertices, faces, variant)
    small = sensor.scaled(0.125)
    poses = sample_contact_poses(mesh, 2, np.random.default_rng(3), sensor)
    rendered = PenetrationRenderer(mesh, small).render(poses)
    expected = np.stack([ray_cast(mesh, pose, small) for pose in poses])
    assert expected.max() > 3e-4
    assert np.sqrt(((rendered - expected) ** 2).mean()) < 1e-7


def test_flat_press_has_the_known_penetration(block, sensor):
    """Pressed 1 mm onto a flat side, the apex sinks in by exactly 1 mm and the dome's sag limits the contact."""
    pose = se3.translation([0, 0, 0.01 - 1e-3])
    penetration = PenetrationRenderer(block, sensor).render(pose[None])[0]
    assert penetration[160, 120] == pytest.approx(1e-3, abs=2e-6)
    touched = penetration[160] > 0
    radius = touched.sum() / 2 * 0.021 / sensor.focal
    assert radius == pytest.approx(np.sqrt(2 * 0.0327684 * 1e-3), rel=0.02)
    assert not PenetrationRenderer(block, sensor).render(se3.translation([0, 0, 0.03])[None]).any()


def test_normals_of_a_flat_side(block, sensor):
    renderer = PenetrationRenderer(block, sensor.scaled(0.25))
    turned = se3.make(se3.exp(np.array([0, 0, 0, 0.05, 0, 0]))[:3, :3], [0, 0, 0.009])
    penetration, normals = renderer.render_with_normals(turned[None])
    np.testing.assert_array_equal(penetration, renderer.render(turned[None]))
    middle = normals[0, 35:45, 25:35].reshape(-1, 3)
    np.testing.assert_allclose(middle, np.tile([0, np.sin(0.05), np.cos(0.05)], (100, 1)), atol=2e-3)
    np.testing.assert_array_equal(np.linalg.norm(normals[0], axis=-1) > 0.5, penetration[0] > 0)


def test_batches_equal_single_renders(tool, sensor):
    renderer = PenetrationRenderer(tool, sensor.scaled(0.25))
    poses = sample_contact_poses(tool, 9, np.random.default_rng(0), sensor)
    one_by_one = np.concatenate([renderer.render(pose[None]) for pose in poses])
    np.testing.assert_array_equal(renderer.render(poses), one_by_one)
    with pytest.raises(ValueError, match=r"\(N, 4, 4\)"):
        renderer.render(poses[0])


def test_the_gel_keeps_the_object_s_shape_and_follows_beside_it(cap, real):
    height = sunk_in(cap, real.pixel_size, REACH, 1.0)
    depth = (height - cap)[cap > 0]
    np.testing.assert_allclose(depth, depth[0], rtol=1e-4)
    beside = height[80, 60:]
    assert (np.diff(beside) <= 1e-9).all(), "falls away from the contact"
    assert 0 < beside[-1] < 0.05 * depth[0]
    slopes = np.diff(height[80, 60:]) / real.pixel_size
    rim = int(np.flatnonzero(cap[80, 60:] == 0)[0])
    assert slopes[rim - 1 : rim + 2].min() > 1.1 * slopes[rim - 2], "no steeper than the object"
    assert slopes[rim + 1] < 0.4 * slopes[rim - 2], "nor flat at once"


def test_stiff_gel_or_a_contact_all_over_does_not_sink_in(cap, real):
    np.testing.assert_array_equal(sunk_in(cap, real.pixel_size, REACH, 0.0), cap)
    whole = np.full_like(cap, 1e-3)
    np.testing.assert_array_equal(sunk_in(whole, real.pixel_size, REACH, 1.0), whole)
    assert not sunk_in(np.zeros_like(cap), real.pixel_size, REACH, 1.0).any()
