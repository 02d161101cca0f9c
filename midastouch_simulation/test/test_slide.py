import numpy as np
import pytest

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_perception.objects import bundled_objects
from midastouch_perception.rendering.contact_poses import Reachability
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_simulation.procedural import box, mesh_from_sdf
from midastouch_simulation.slide import Leap, measure_poses, simulate_slide, somewhere


def deepest(mesh, poses, sensor):
    return PenetrationRenderer(mesh, sensor.scaled(0.25)).render(poses).max(axis=(1, 2))


@pytest.mark.parametrize("name", sorted(bundled_objects()))
def test_slide_stays_in_contact_in_even_steps(name, sensor):
    mesh = ObjectMesh.load(bundled_objects()[name])
    poses = simulate_slide(mesh, sensor, 0.06, np.random.default_rng(0))
    assert len(poses) == 40
    steps = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1)
    assert steps.max() < 4e-3
    depths = deepest(mesh, poses, sensor)
    assert 2e-4 < depths.min() <= depths.max() < 2.2e-3
    np.testing.assert_array_equal(poses, simulate_slide(mesh, sensor, 0.06, np.random.default_rng(0)))
    turns = se3.rotation_angle(se3.inverse(poses[:-1])[:, :3, :3] @ poses[1:, :3, :3])
    assert np.degrees(turns.max()) < 13


def test_measured_poses_have_the_stated_noise():
    poses = np.tile(np.eye(4), (4000, 1, 1))
    error = se3.log(measure_poses(poses, np.random.default_rng(0)))
    np.testing.assert_allclose(error.std(axis=0), [5e-4] * 3 + [np.radians(1)] * 3, rtol=0.06)


def test_it_starts_outside_of_an_object_of_two_bodies(sensor):
    """A post stands 20 mm deep in a block of 60 mm; below it, inside the block, is room for a finger."""
    size, half = np.full(3, 0.055), np.array([0.05, 0.05, 0.03])
    block, post = (mesh_from_sdf(box(each, 0.002), size, 2e-3, "body") for each in (tuple(half), (0.03, 0.03, 0.02)))
    vertices = np.vstack([block.vertices, post.vertices + np.array([0, 0, 0.03])])
    both = ObjectMesh.from_arrays(vertices, np.vstack([block.faces, post.faces + len(block.vertices)]), "both")
    reachability, rng = Reachability(both, sensor), np.random.default_rng(0)
    starts = np.array([somewhere(both, reachability, 5e-4, rng) for _ in range(60)])
    assert (np.abs(starts) > half - 3e-3).any(axis=1).all()


def test_object_out_of_reach_is_named(sensor):
    """A one-sided plate, approached from behind: nothing to touch."""
    corners = np.array([[0, 0, 0], [0.05, 0, 0], [0.05, 0.05, 0], [0, 0.05, 0]])
    plate = ObjectMesh.from_arrays(corners, np.array([[0, 1, 2], [0, 2, 3]]), "plate")
    plate.face_normals = -plate.face_normals
    with pytest.raises(InputError, match="plate: no reachable"):
        simulate_slide(plate, sensor, 0.05, np.random.default_rng(0))


@pytest.mark.parametrize(("leap", "angle"), [(Leap(0.03, np.radians(175)), 175), (Leap(0.05), None)])
def test_a_leap_is_one_step_after_a_third(tool, sensor, leap, angle):
    poses = simulate_slide(tool, sensor, 0.045, np.random.default_rng(2), leap=leap)
    steps = se3.inverse(poses[:-1]) @ poses[1:]
    distance, turn = np.linalg.norm(steps[:, :3, 3], axis=1), se3.rotation_angle(steps[:, :3, :3])
    assert np.argmax(distance) == leap.at(len(poses)) - 1 == 9
    assert distance.max() == pytest.approx(leap.distance, abs=3e-3)
    assert np.delete(distance, 9).max() < 5e-3
    if angle:
        assert np.degrees(turn[9]) == pytest.approx(angle, abs=6)
    # the way to it is that of a slide without
    np.testing.assert_array_equal(poses[:10], simulate_slide(tool, sensor, 0.045, np.random.default_rng(2))[:10])
    assert deepest(tool, poses, sensor).min() > 2e-4
