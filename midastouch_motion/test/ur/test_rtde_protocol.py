"""ur-rtde itself against a server that speaks RTDE as a controller does."""

import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from midastouch_motion.ur.rtde import RTDE_PORT, rtde_connector, transform_from_rtde

pytest.importorskip("rtde_receive", reason="needs ur-rtde: pip install ur-rtde")

# of this run of the tests, as its domain is: the port is the controller's own
ADDRESS = f"127.0.0.{os.environ['ROS_DOMAIN_ID']}"
POSE = [0.3, -0.2, 0.4, 0.1, 2.6, -0.2]  # what rtde_server.py sends


@pytest.fixture
def controller():
    command = [sys.executable, Path(__file__).with_name("rtde_server.py"), ADDRESS, str(RTDE_PORT), ""]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    if process.stdout.readline() != "ready\n":
        pytest.skip(f"port {RTDE_PORT} is taken: {process.communicate()[1].splitlines()[-1]}")
    yield process
    process.kill()
    process.communicate()


def until(condition):
    end = time.monotonic() + 120.0  # bounds a failing test only
    while not (value := condition()):
        assert time.monotonic() < end, "the awaited state did not come"
        time.sleep(0.01)
    return value


def test_state_comes_and_advances_until_the_controller_is_gone(controller):
    arm = rtde_connector(timeout=60.0)(ADDRESS, 125.0)
    first = until(lambda: (state := arm.read()) and state.robot_time > 1000.0 and state)
    np.testing.assert_allclose(transform_from_rtde(first.tcp_pose), transform_from_rtde(POSE), atol=1e-12)
    np.testing.assert_allclose(first.positions, [first.robot_time] + [0.1] * 5)
    np.testing.assert_allclose(first.velocities, [0.2] * 6)
    until(lambda: arm.read().robot_time > first.robot_time)
    assert controller.stdout.readline() == "frequency 125.0\n"
    controller.kill()
    controller.wait()
    until(lambda: arm.read() is None)
    arm.close()
