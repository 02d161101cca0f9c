import numpy as np
import pytest
import trimesh

from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_perception.rendering.contact_poses import MAX_PENETRATION
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.simulation.grasp import CONTACTS, simulate_grasps


@pytest.fixture(scope="module")
def grasps(tool, sensor):
    return simulate_grasps(tool, sensor, 20, np.random.default_rng(0))


def test_every_finger_touches_and_can_be_there(grasps, tool, sensor):
    assert grasps.shape == (20, CONTACTS, 4, 4)
    deepest = PenetrationRenderer(tool, sensor.scaled(0.25)).render(grasps.reshape(-1, 4, 4)).max(axis=(1, 2))
    assert deepest.min() > 1e-4
    assert deepest.max() < MAX_PENETRATION + 2e-4


def test_fingers_are_within_a_hand_and_not_in_each_other(grasps):
    behind = grasps[:, :, :3, 3] + 0.015 * grasps[:, :, :3, 2]
    for a in range(CONTACTS):
        for b in range(a):
            assert np.linalg.norm(behind[:, a] - behind[:, b], axis=1).min() >= 0.03
            assert np.linalg.norm(grasps[:, a, :3, 3] - grasps[:, b, :3, 3], axis=1).max() <= 0.12


def test_the_second_finger_opposes_the_first(grasps):
    normals = grasps[:, :2, :3, 2]
    assert np.median((normals[:, 0] * normals[:, 1]).sum(axis=1)) < -0.9


def test_a_seed_fixes_the_grasps(tool, sensor, grasps):
    np.testing.assert_array_equal(simulate_grasps(tool, sensor, 20, np.random.default_rng(0)), grasps)


def test_an_object_too_small_for_a_hand_is_refused(sensor):
    pebble = trimesh.creation.icosphere(3, 0.004)
    mesh = ObjectMesh.from_arrays(pebble.vertices, pebble.faces, "pebble")
    with pytest.raises(InputError, match="pebble: "):
        simulate_grasps(mesh, sensor, 1, np.random.default_rng(0))
