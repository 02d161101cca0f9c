"""ur-rtde itself against a server that speaks RTDE as a controller does."""

import numpy as np

from midastouch_motion.ur.rtde import rtde_connector, transform_from_rtde

from .controller_process import ADDRESS, BASE_FROM_TCP, until
from .ur_controller import WRENCH


def test_state_comes_and_advances_until_the_controller_is_gone(ur_controller):
    controller = ur_controller()
    arm = rtde_connector(timeout=60.0)(ADDRESS, 125.0)
    first = until(lambda: (state := arm.read()) and state.robot_time > 1000.0 and state)
    np.testing.assert_allclose(transform_from_rtde(first.tcp_pose), BASE_FROM_TCP, atol=1e-12)
    np.testing.assert_allclose(first.positions, [first.robot_time] + [0.1] * 5)
    np.testing.assert_allclose(first.velocities, [0.2] * 6)
    np.testing.assert_allclose(first.wrench, WRENCH)
    until(lambda: arm.read().robot_time > first.robot_time)
    assert controller.said("frequency")[-1] == 125.0
    controller.end()
    until(lambda: arm.read() is None)
    arm.close()
