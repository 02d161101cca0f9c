"""The loop of the program, over an arm that writes down what it is asked for."""

import time

import numpy as np
import pytest

from midastouch_motion.ur.orders import ALIVE, Order
from midastouch_motion.ur.rtde import ArmState
from midastouch_motion.ur.ur_follower import follow

HALF_TURN = np.array([0.3, 0.2, 0.1, 0.0, 0.0, np.pi])
TIMEOUT = 30.0  # s; orders of an age say by themselves what is too old


class Arm:
    """Its clock goes on at each look, unless it is silent."""

    def __init__(self):
        self.done, self.time, self.silent = [], 0.0, False

    def state(self):
        self.time += 0 if self.silent else 0.008
        return ArmState(self.time, HALF_TURN, *np.zeros((3, 6)))

    def move(self, velocity):
        self.done.append(("move", *np.round(velocity, 9)))

    def __getattr__(self, name):
        return lambda: self.done.append(name)


class Script:
    """Orders that come one after the other: a twist's first number and the age [s], or None."""

    def __init__(self, *orders):
        self._orders = iter(orders)

    def wait(self, seconds):
        coming = next(self._orders, EOFError)
        if coming is EOFError:
            raise EOFError
        return coming and Order(time.monotonic() - coming[1], np.array([coming[0], 0, 0, 0, 0, 0]))


def run(*orders):
    arm, reports = Arm(), []
    follow(arm, Script(*orders), TIMEOUT, reports.append)
    assert reports[0] == ALIVE
    return arm.done


@pytest.mark.parametrize("last", [(0.1, 2 * TIMEOUT), (0.0, 0.0), None])
def test_it_stops_once(last):
    assert run((0.1, 0.0), last, last) == ["kick", ("move", -0.1, 0, 0, 0, 0, 0), "stop", "kick", "end"]


def test_an_old_order_does_not_move_it():
    assert run((0.1, 2 * TIMEOUT)) == ["kick", "kick", "end"]


def test_a_silent_arm_is_lost():
    arm = Arm()
    arm.silent = True

    class Waiting:
        def wait(self, seconds):
            time.sleep(seconds)

    with pytest.raises(ConnectionError, match="no new sample"):
        follow(arm, Waiting(), TIMEOUT, lambda words: None)
    assert set(arm.done) == {"kick"}
