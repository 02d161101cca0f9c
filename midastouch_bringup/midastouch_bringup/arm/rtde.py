"""Reads the state of a Universal Robots arm through the package `ur-rtde`, without ROS."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from midastouch_common.errors import InputError

from .rtde_handshake import require_outputs

RTDE_PORT = 30004
_OUTPUTS = ["timestamp", "actual_TCP_pose", "actual_q", "actual_qd"]


@dataclass(frozen=True)
class ArmState:
    """One sample of the arm."""

    robot_time: float  # s since the controller's start
    tcp_pose: np.ndarray  # (6,) [x y z rx ry rz], m and rad, of the TCP in `base`
    positions: np.ndarray  # (6,) rad
    velocities: np.ndarray  # (6,) rad/s


class RtdeReceiver:
    """One connection to an arm."""

    def __init__(self, arm):
        self._arm = arm

    def read(self) -> ArmState | None:
        """The newest state, the same again if no new one has arrived; None once the connection is lost."""
        while self._arm.isConnected():
            state = ArmState(
                self._arm.getTimestamp(),
                np.array(self._arm.getActualTCPPose()),
                np.array(self._arm.getActualQ()),
                np.array(self._arm.getActualQd()),
            )
            # the library's thread may have put in the next state between two of these calls
            if self._arm.getTimestamp() == state.robot_time:
                return state
        return None

    def close(self) -> None:
        """End the connection."""
        self._arm.disconnect()


def rtde_connector(timeout: float = 2.0) -> Callable[[str, float], RtdeReceiver]:
    """A function (robot_ip, rate in Hz) -> RtdeReceiver that raises ConnectionError if the arm is silent.

    Raises InputError when `ur-rtde`, which only arms without a ROS driver need, is not installed.
    """
    try:
        from rtde_receive import RTDEReceiveInterface
    except ImportError as error:
        raise InputError("ur_tf needs the Python package ur-rtde; install it: pip install ur-rtde") from error

    def connect(robot_ip: str, rate: float) -> RtdeReceiver:
        require_outputs(robot_ip, RTDE_PORT, _OUTPUTS, rate, timeout)
        try:
            return RtdeReceiver(RTDEReceiveInterface(robot_ip, rate, _OUTPUTS))
        except RuntimeError as error:
            raise ConnectionError(f"no RTDE at {robot_ip}:{RTDE_PORT}: {error}") from error

    return connect
