import numpy as np
import pytest

from midastouch_common import se3
from midastouch_filter.arm_calibration.contact_odometry import ContactOdometry
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.noise_model import NoiseModel
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_model import SensorModel

SENSOR = SensorModel.load("digit_tacto").scaled(0.25)
CONFIG = FilterConfig()


@pytest.fixture
def odometry():
    return ContactOdometry(SENSOR, NoiseModel.of(CONFIG), CONFIG.object_jump + 2 * CONFIG.jitter)


def felt(mesh, poses):
    return np.maximum(PenetrationRenderer(mesh, SENSOR).render(np.asarray(poses)), 0)


def test_the_motion_over_a_bump_is_found_whatever_the_arm_says(world, odometry):
    rng = np.random.default_rng(3)
    wrong, misled = [], []
    for slide in (world.make_slide(world.mesh, 2, rng) for _ in range(20)):
        first, second = felt(world.mesh, slide)
        motion = se3.inverse(slide[0]) @ slide[1]
        arm = motion @ se3.exp([0, 0, 2e-3, 0, 0, 0])  # the object slips towards the gel
        odometry.keep(first, None)
        found = odometry.register(second, arm)
        wrong.append(abs((se3.inverse(motion) @ found)[2, 3]))
        misled.append(abs((se3.inverse(motion) @ arm)[2, 3]))
    assert np.median(wrong) < 0.1 * np.median(misled)


def test_where_nothing_is_felt_the_guess_stands(odometry):
    nothing = np.zeros(SENSOR.gel_depth.shape, np.float32)
    guess = se3.exp([1e-3, 0, 5e-4, 0, 0.01, 0])
    odometry.keep(nothing, None)
    np.testing.assert_allclose(odometry.register(nothing, guess), guess, atol=1e-12)


def test_there_is_no_motion_to_the_first_map(world, odometry):
    first, second = felt(world.mesh, world.poses[:2])
    assert odometry.register(first, np.eye(4)) is None
    odometry.keep(first, None)
    assert odometry.is_last(first)
    assert not odometry.is_last(second)
    odometry.restart()
    assert odometry.register(second, np.eye(4)) is None


def test_a_map_of_another_size_is_refused(odometry):
    odometry.keep(np.zeros(SENSOR.gel_depth.shape, np.float32), None)
    with pytest.raises(ValueError, match="another size"):
        odometry.register(np.zeros((4, 4), np.float32), np.eye(4))
