import numpy as np
import pytest
import trimesh

from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_simulation.grasp import CONTACTS, simulate_grasp


@pytest.fixture(scope="module")
def grasps(tool, sensor):
    return np.stack([simulate_grasp(tool, sensor, np.random.default_rng(seed)) for seed in range(20)])


def test_every_finger_is_pressed_in_and_none_deeply(grasps, tool, sensor):
    assert grasps.shape == (20, CONTACTS, 4, 4)
    deepest = PenetrationRenderer(tool, sensor.scaled(0.25)).render(grasps.reshape(-1, 4, 4)).max(axis=(1, 2))
    assert 2e-4 < deepest.min() < 5e-4
    assert 1.3e-3 < deepest.max() < 1.6e-3


def bodies(grasps: np.ndarray) -> np.ndarray:
    """(..., 3) of the middle of the fingers behind gels (..., 4, 4)."""
    return grasps[..., :3, 3] + 0.015 * grasps[..., :3, 2]


def test_clear_fingers_side_by_side_oppose_the_thumb(grasps, tool):
    behind = bodies(grasps)
    _, distance, _ = tool.closest_points(behind.reshape(-1, 3))
    assert distance.min() >= 0.01
    for a in range(CONTACTS):
        for b in range(a):
            assert np.linalg.norm(behind[:, a] - behind[:, b], axis=1).min() >= 0.02
            assert np.linalg.norm(grasps[:, a, :3, 3] - grasps[:, b, :3, 3], axis=1).max() <= 0.14
    z = grasps[:, :, :3, 2]
    for finger in (1, 2):
        assert np.median((z[:, 0] * z[:, finger]).sum(axis=1)) < -0.7
    assert np.median((z[:, 1] * z[:, 2]).sum(axis=1)) > 0.7


@pytest.mark.slow
def test_a_box_is_held_by_faces_and_a_pebble_not_at_all(sensor):
    box = trimesh.creation.box(sides := np.array([0.12, 0.06, 0.04]))
    mesh = ObjectMesh.from_arrays(box.vertices, box.faces, "box")
    grasps = np.stack([simulate_grasp(mesh, sensor, np.random.default_rng(seed)) for seed in range(20)])
    on_face = np.abs(grasps[..., :3, 2]).max(axis=-1) > np.cos(np.radians(15))
    assert 0.6 < on_face.mean() < 1.0
    assert (np.abs(bodies(grasps)) > sides / 2).any(axis=-1).all()
    pebble = trimesh.creation.icosphere(3, 0.004)
    mesh = ObjectMesh.from_arrays(pebble.vertices, pebble.faces, "pebble")
    with pytest.raises(InputError, match="pebble: "):
        simulate_grasp(mesh, sensor, np.random.default_rng(0))
