import numpy as np

from midastouch_perception.rendering.contact_poses import sample_contact_poses
from midastouch_perception.rendering.renderer import PenetrationRenderer


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


def test_calibration_is_usable(tcn):
    assert 0 < tcn.calibration["temperature"] < 1
    assert 0 <= tcn.calibration["outlier"] < 0.5
