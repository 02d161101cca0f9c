import numpy as np

from midastouch_bringup.arm.robot_clock import RobotClock

SECOND = 1_000_000_000
START = 1_700_000_000 * SECOND


def test_polling_delay_is_taken_out():
    rng = np.random.default_rng(0)
    clock, errors = RobotClock(), []
    for k in range(2000):
        robot = 100.0 + k * 0.002
        measured = START + k * 2_000_000
        arrival = measured + 300_000 + round(rng.exponential(3e6))  # 0.3 ms transport, then jitter
        errors.append(clock.stamp(robot, arrival) - measured)
    settled = np.array(errors[200:])
    # what stays is the least delay; the jitter (3 ms) is gone
    assert settled.min() >= 300_000
    assert settled.max() < 400_000


def test_stamps_never_lie_in_the_future():
    rng = np.random.default_rng(1)
    clock = RobotClock()
    for k in range(500):
        arrival = START + k * 8_000_000 + round(rng.uniform(0, 5e6))
        assert clock.stamp(k * 0.008, arrival) <= arrival


def test_drift_is_followed():
    clock = RobotClock(window_s=2.0)
    for k in range(20_000):  # 160 s at 100 ppm: 16 ms apart at the end
        arrival = START + round(k * 8_000_000 * (1 + 100e-6))
        stamp = clock.stamp(k * 0.008, arrival)
    assert abs(stamp - arrival) < 250_000


def test_a_step_of_our_clock_is_forgotten_after_the_window():
    clock = RobotClock(window_s=1.0)
    for k in range(1000):
        step = 500_000_000 if k >= 500 else 0
        arrival = START + k * 8_000_000 + step
        stamp = clock.stamp(k * 0.008, arrival)
    assert stamp == arrival


def test_a_restarted_controller_starts_over():
    clock = RobotClock()
    clock.stamp(5000.0, START)
    assert clock.stamp(1.0, START + 60 * SECOND) == START + 60 * SECOND
