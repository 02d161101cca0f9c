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


def shifted(truth: np.ndarray, millimetres: float, degrees: float) -> np.ndarray:
    turned = truth @ se3.exp(np.array([0, 0, 0, np.radians(degrees), 0, 0]))
    turned[:3, 3] += np.array([0, 1e-3 * millimetres, 0])
    return turned


@pytest.fixture
def truth() -> np.ndarray:
    return se3.exp(np.array([0.1, -0.2, 0.05, 1.0, -2.0, 0.5]))


def test_particle_rmse_is_equation_3(truth):
    particles = np.array([shifted(truth, 3, 10), shifted(truth, 4, 20)])
    e_trans, e_rot = pose_metric.particle_rmse(particles, truth)
    assert e_trans == pytest.approx(1e-3 * np.sqrt((9 + 16) / 2))
    assert np.degrees(e_rot) == pytest.approx(np.sqrt((100 + 400) / 2))


def test_weights_replace_the_mean(truth):
    particles = np.array([shifted(truth, 3, 10), shifted(truth, 40, 90)])
    assert pose_metric.particle_rmse(particles, truth, [1.0, 0.0]) == pytest.approx(
        pose_metric.particle_rmse(particles[:1], truth)
    )
    # a weighted set has the error of the set in which particles are repeated in proportion
    repeated = pose_metric.particle_rmse(particles[[0, 0, 0, 1]], truth)
    assert pose_metric.particle_rmse(particles, truth, [0.75, 0.25]) == pytest.approx(repeated)


def test_only_equation_4_takes_its_minima_apart(truth):
    near, aligned = shifted(truth, 1, 60), shifted(truth, 8, 2)
    e_trans, e_rot = pose_metric.min_cluster_error(np.array([near, aligned]), truth)
    assert (1e3 * e_trans, np.degrees(e_rot)) == pytest.approx((1, 2))
    e_trans, e_rot = pose_metric.closest_mode_error(np.array([near, aligned]), truth)
    assert (1e3 * e_trans, np.degrees(e_rot)) == pytest.approx((8, 2))  # 60 deg count as 10.5 mm


def test_without_modes_there_is_no_error(truth):
    assert np.isnan(pose_metric.min_cluster_error(np.zeros((0, 4, 4)), truth)).all()
    assert np.isnan(pose_metric.closest_mode_error(np.zeros((0, 4, 4)), truth)).all()
