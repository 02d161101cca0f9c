import numpy as np
import pytest

from midastouch_perception.rendering.contact_poses import sample_contact_poses
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tcn.inference import code_input


def test_single_and_batch_agree(tcn, tool):
    poses = sample_contact_poses(tool, 70, np.random.default_rng(0), tcn.sensor)
    maps = PenetrationRenderer(tool, tcn.sensor).render(poses)
    batch = tcn.encode(maps)
    assert batch.shape == (70, tcn.dim)
    np.testing.assert_allclose(tcn.encode(maps[67]), batch[67], atol=1e-4)
    np.testing.assert_allclose(np.linalg.norm(batch, axis=1), 1, atol=1e-4)


def test_near_touches_score_higher_than_far_ones(tcn, tool):
    """The point of the code: a small step on the surface keeps it, another place does not."""
    rng = np.random.default_rng(1)
    poses = sample_contact_poses(tool, 64, rng, tcn.sensor)
    renderer = PenetrationRenderer(tool, tcn.sensor)
    moved = poses.copy()
    moved[:, :3, 3] += 1e-3 * poses[:, :3, 0]
    here, near = tcn.encode(renderer.render(poses)), tcn.encode(renderer.render(moved))
    near_score = (here * near).sum(axis=1)
    far_score = (here @ here.T)[~np.eye(64, dtype=bool)]
    assert near_score.mean() > far_score.mean() + 0.3


@pytest.fixture(params=["tcn", "minkloc"])
def network(request):
    return request.getfixturevalue(request.param)


def test_empty_and_one_point_maps_have_unit_codes(network):
    maps = np.zeros((2, 160, 120), np.float32)
    maps[1, 0, 0] = 1e-3
    np.testing.assert_allclose(np.linalg.norm(network.encode(maps), axis=1), 1, atol=1e-4)
    assert network.encode(maps[:0]).shape == (0, network.dim)


def test_depth_and_contact_are_metric_means_of_four_pixels():
    sensor = SensorModel.load("digit_tacto").for_maps
    maps = np.zeros((2, sensor.height, sensor.width), np.float32)
    maps[1, :2, 2:4] = [[1e-3, 0], [0, 2e-3]]
    out = code_input(maps, sensor)
    assert out.shape == (2, 4, sensor.height // 2, sensor.width // 2)
    np.testing.assert_allclose(out[1, :2, 0, 1], [0.75, 0.5], rtol=1e-6)  # mm; fraction
    assert np.count_nonzero(out[:, :2]) == 2
    x, y = out[0, 2:]
    assert (np.diff(x, axis=1) > 0).all()
    assert (np.diff(y, axis=0) < 0).all()
    # the places are pixels' on the gel, the same for every map: centimetres about the middle
    np.testing.assert_allclose(x, -x[:, ::-1], atol=1e-6)
    assert 0.5 < x.max() < 2
    assert np.array_equal(out[0, 2:], out[1, 2:])
