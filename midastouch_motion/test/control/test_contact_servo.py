import numpy as np
import pytest

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_motion.control.contact_servo import ContactServo, Limits
from midastouch_motion.control.measured import Measured, slope_of
from midastouch_motion.control.wrench import GEL_STIFFNESS
from midastouch_perception.sensor_model import SensorModel
from midastouch_simulation.gel_layer import Gel, GelLayer

SENSOR = SensorModel.load("digit_tacto").for_maps


def plane(slope, size):
    """Points of a plane through the gel's apex, `size` m across."""
    x, y = np.meshgrid(*[np.linspace(-size / 2, size / 2, 11)] * 2)
    return np.stack([x.ravel(), y.ravel(), slope[0] * x.ravel() + slope[1] * y.ravel()], axis=1)


def test_the_slope_is_that_of_the_points_and_less_of_close_ones():
    np.testing.assert_allclose(slope_of(plane((0.1, -0.05), 0.04), SENSOR), [0.1, -0.05], rtol=0.05)
    assert np.linalg.norm(slope_of(plane((0.1, -0.05), 0.001), SENSOR)) < 0.02
    assert not slope_of(np.zeros((2, 3)), SENSOR).any()


def test_a_small_contact_beside_the_apex_has_the_dome_s_slope():
    beside = plane((0.0, 0.0), 1e-4) + np.array([6e-3, 0.0, 0.0])
    slope = slope_of(beside, SENSOR)
    assert slope[0] == pytest.approx(6e-3 / dict(SENSOR.dome)["radius_x"], rel=0.05)
    assert abs(slope[1]) < 1e-3
    flat = SensorModel.load("gelsight_mini")
    assert np.linalg.norm(slope_of(beside, flat)) < 1e-3


def test_limits_that_are_none_are_refused():
    with pytest.raises(InputError, match="limit speed: 0 is not"):
        Limits(speed=0.0)
    with pytest.raises(InputError, match="limit depth: nan is not"):
        Limits(depth=float("nan"))


def servo_at(now, depth, slope=(0.0, 0.0), age=0.05):
    servo = ContactServo(Limits(), 0.05)
    servo.stop(now - 0.01)
    servo.measure(now, Measured(now - age, depth, np.array(slope), np.zeros(2)))
    return servo


def test_what_was_commanded_since_an_image_counts():
    servo = servo_at(0.0, 0.3e-3)
    assert servo.depth == pytest.approx(0.3e-3)
    for k in range(1, 6):
        servo.command(0.01 * k, np.array([0, 0, -0.005, 0.1, 0, 0]))
    # 50 ms at 5 mm/s, less what it took to get as fast
    assert servo.depth == pytest.approx(0.3e-3 + 0.04 * 0.005, rel=0.2)
    assert servo.slope[1] == pytest.approx(-0.1 * 0.04, rel=0.3)
    servo.stop(0.06)
    servo.measure(0.2, Measured(0.15, 0.4e-3, np.zeros(2), np.zeros(2)))
    assert servo.depth == pytest.approx(0.4e-3), "all of it is in the image"


def test_the_gel_is_turned_until_it_lies_flat():
    for slope in ((0.1, 0.0), (0.0, 0.1), (-0.1, 0.05)):
        servo = servo_at(0.0, 0.5e-3, slope)
        twist = servo.pressed(0.5e-3, np.zeros(2))
        servo = servo_at(0.0, 0.5e-3, slope)
        for k in range(1, 30):
            servo.command(0.01 * k, twist)
        assert np.linalg.norm(servo.slope) < np.linalg.norm(slope)


def test_limits_hold_and_stopping_is_at_once():
    servo = servo_at(0.0, 0.5e-3)
    sent = [servo.command(0.01 * k, np.array([1.0, 0, 0, 0, 9.0, 0])) for k in range(40)]
    speeds = [np.linalg.norm(twist[:3]) for twist in sent]
    assert max(speeds) == pytest.approx(Limits().speed)
    assert max(np.diff([0.0, *speeds])) <= Limits().acceleration * 0.01 + 1e-9
    assert max(np.linalg.norm(twist[3:]) for twist in sent) == pytest.approx(Limits().turn_speed)
    assert not servo.stop(0.5).any()


def test_a_slow_pipeline_makes_the_servo_slower_and_gentler():
    quick, slow = servo_at(0.0, 0.0, age=0.02), servo_at(0.0, 0.0, age=0.4)
    assert slow.delay > quick.delay
    assert slow.gain < quick.gain
    for servo, stamp, age in ((quick, 1 / 30, 0.02), (slow, 0.2, 0.4)):
        for number in range(1, 40):  # a contact that begins right after an image is known when the next one comes
            servo.measure(number * stamp + age, Measured(number * stamp, 0.0, np.zeros(2), np.zeros(2)))
        assert servo.approach_speed(0.5e-3) * (stamp + age + servo.arm_latency) == pytest.approx(0.5e-3)


def test_what_has_just_touched_is_slower_at_once():
    servo = servo_at(0.0, 0.0)
    for k in range(1, 40):
        servo.command(0.01 * k, np.array([0.0, 0, -1, 0, 0, 0]))
    assert np.linalg.norm(servo.command(0.4, np.array([0.0, 0, -1, 0, 0, 0]))) == pytest.approx(Limits().air_speed)
    servo.measure(0.41, Measured(0.4, 1e-4, np.zeros(2), np.zeros(2)))
    assert np.linalg.norm(servo.command(0.41, np.array([0.0, 0, -1, 0, 0, 0]))) <= Limits().speed


@pytest.mark.parametrize("depth", [3e-4, 6e-4, 1e-3])
def test_the_volume_in_an_image_explains_the_force_of_a_gel(world, depth):
    ball = world("ball", noise=0.0)
    pose = se3.translation([0.0, 0.0, ball.mesh.bounds[1, 2] - depth])
    servo = ContactServo(Limits(), 0.05)
    servo.measure(0.05, ball.look(pose))
    force = GelLayer(ball.mesh, SensorModel.load("digit_tacto"), Gel()).force(pose, np.zeros(2), 0.01)[2]
    assert 1.0 < GEL_STIFFNESS * servo.displaced / force < 2.0


def test_soft_gel_displaces_more_than_the_shape_within_its_contact():
    apex = plane((0.0, 0.0), 2e-3)
    flat = SensorModel.load("gelsight_mini")
    sunk_in, shape = (Measured.of(0.0, depth, 4e-6, apex, flat).mean for depth in (5e-4, 1e-4))
    assert sunk_in - shape == pytest.approx(4e-4)


def test_an_approach_is_no_faster_than_a_contact_may_be():
    servo = servo_at(0.0, 0.0)
    assert servo.approach_speed(1.0) == Limits().speed


@pytest.mark.parametrize("depth", [2e-4, 5e-4, 9e-4])
def test_a_turn_brings_the_gel_s_corners_down_to_twice_the_depth_at_most(depth):
    servo = servo_at(0.0, depth, (0.5, 0.0))
    turn = np.linalg.norm(servo.pressed(5e-4, np.zeros(2))[3:])
    blind = 0.2 + servo.arm_latency
    assert turn * 1.2e-2 * blind == pytest.approx(2 * 5e-4 - depth)
    assert turn < Limits().turn_speed
