import numpy as np
import pytest

from midastouch_common import pose_metric, se3


def test_errors_are_a_distance_and_the_angle_on_so3_of_all_pairs():
    rng = np.random.default_rng(1)
    poses = se3.exp(rng.normal(0, [0.1] * 3 + [1.0] * 3, (5, 6)))
    moved = poses @ se3.make(se3.exp([0, 0, 0, 0, 0.2, 0])[:3, :3], [0.003, 0, 0])
    distance, angle = pose_metric.pose_errors(poses, moved)
    assert distance == pytest.approx(np.full(5, 0.003))
    assert angle == pytest.approx(np.full(5, 0.2))
    distance, angle = pose_metric.pose_errors(poses[:, None], moved)
    assert distance.shape == angle.shape == (5, 5)
    assert angle[2, 4] == pytest.approx(np.linalg.norm(se3.log(se3.inverse(poses[2]) @ moved[4])[3:]))


def test_six_vectors_scale_the_log_of_rotation():
    pose = se3.make(se3.exp(np.array([0, 0, 0, 0, 0, 0.5]))[:3, :3], [0.1, 0.2, 0.3])
    assert pose_metric.six_vectors(pose[None])[0] == pytest.approx([0.1, 0.2, 0.3, 0, 0, 0.005])


def test_geodesic_distance_is_continuous_where_six_vectors_jump():
    before, after = (se3.exp(np.array([0, 0, 0, 0, 0, a])) for a in (np.pi - 0.01, np.pi + 0.01))
    jump = np.linalg.norm(np.diff(pose_metric.six_vectors(np.array([before, after])), axis=0))
    assert jump > 0.06
    assert pose_metric.geodesic_distances(before, after) == pytest.approx(0.02 * pose_metric.ROTATION_SCALE)
