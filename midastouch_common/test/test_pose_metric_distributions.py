import numpy as np
import pytest

from midastouch_common import pose_metric as metrics
from midastouch_common import se3


def shifted(truth: np.ndarray, millimetres: float, degrees: float) -> np.ndarray:
    turned = truth @ se3.exp(np.array([0, 0, 0, np.radians(degrees), 0, 0]))
    turned[:3, 3] += np.array([0, 1e-3 * millimetres, 0])
    return turned


@pytest.fixture
def truth() -> np.ndarray:
    return se3.exp(np.array([0.1, -0.2, 0.05, 1.0, -2.0, 0.5]))


def test_particle_rmse_is_equation_3(truth):
    particles = np.array([shifted(truth, 3, 10), shifted(truth, 4, 20)])
    e_trans, e_rot = metrics.particle_rmse(particles, truth)
    assert e_trans == pytest.approx(1e-3 * np.sqrt((9 + 16) / 2))
    assert np.degrees(e_rot) == pytest.approx(np.sqrt((100 + 400) / 2))


def test_weights_replace_the_mean(truth):
    particles = np.array([shifted(truth, 3, 10), shifted(truth, 40, 90)])
    assert metrics.particle_rmse(particles, truth, [1.0, 0.0]) == pytest.approx(
        metrics.particle_rmse(particles[:1], truth)
    )
    # a weighted set has the error of the set in which particles are repeated in proportion
    repeated = metrics.particle_rmse(particles[[0, 0, 0, 1]], truth)
    assert metrics.particle_rmse(particles, truth, [0.75, 0.25]) == pytest.approx(repeated)


def test_equation_4_takes_its_minima_apart_and_closest_mode_does_not(truth):
    near, aligned = shifted(truth, 1, 60), shifted(truth, 8, 2)
    e_trans, e_rot = metrics.min_cluster_error(np.array([near, aligned]), truth)
    assert (1e3 * e_trans, np.degrees(e_rot)) == pytest.approx((1, 2))
    e_trans, e_rot = metrics.closest_mode_error(np.array([near, aligned]), truth)
    assert (1e3 * e_trans, np.degrees(e_rot)) == pytest.approx((8, 2))  # 60 deg count as 10.5 mm


def test_without_modes_there_is_no_error(truth):
    assert np.isnan(metrics.min_cluster_error(np.zeros((0, 4, 4)), truth)).all()
    assert np.isnan(metrics.closest_mode_error(np.zeros((0, 4, 4)), truth)).all()
