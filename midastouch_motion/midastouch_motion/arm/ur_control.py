"""Speeds of a UR arm's TCP, by `ur-rtde`'s program on the controller.

That program goes on with the last `speedL` until it is told to stop: the `time` of a `speedL` says only how long the
controller keeps to it before it looks for a newer one. What stops an arm that is not told anything any more is the
controller's watchdog over the input registers.
"""

from __future__ import annotations

import socket
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .rtde import ArmState, RtdeReceiver, rtde_connector

RATE = 125.0
"""Samples and commands per second; every controller can."""
DASHBOARD_PORT, SCRIPT_PORT = 29999, 30003
_GOES_ON = 0.1  # s within which samples tell a lost connection from a program that has ended


@dataclass(frozen=True)
class Stopping:
    """How an arm speeds up and stops [m/s^2], and after how long [s] without a command."""

    acceleration: float
    deceleration: float
    timeout: float


class UrArm:
    """An arm that is connected. Raises ConnectionError, saying why, wherever it does not do what it is told."""

    def __init__(self, control, receiver: RtdeReceiver, stopping: Stopping):
        self._control, self._receiver, self._stopping = control, receiver, stopping

    def begin(self, timeout: float) -> None:
        """Start the program, within `timeout` [s], in place of any other one.

        The controller ends it, and so stops the arm, whenever nothing has come for the timeout of `stopping`.
        """
        self._ask(self._control.reuploadScript)
        end = time.monotonic() + timeout
        while not self._control.isProgramRunning():
            if time.monotonic() > end:
                raise ConnectionError(
                    "the program does not start: power the arm on, release its brakes and stops, enable remote control"
                )
            time.sleep(1.0 / RATE)
        self._ask(self._control.setWatchdog, 1.0 / self._stopping.timeout)

    def state(self) -> ArmState:
        """The newest sample."""
        state = self._receiver.read()
        if state is None or not self._control.isConnected():
            raise ConnectionError("connection lost")
        return state

    def move(self, velocity: np.ndarray) -> None:
        """Twist (6,) of the TCP along the axes of `base`; m/s, rad/s."""
        how = self._stopping
        self._ask(self._control.speedL, velocity.tolist(), how.acceleration, how.timeout)

    def stop(self) -> None:
        """Stand still; returns once it does."""
        self._ask(self._control.speedStop, self._stopping.deceleration)

    def kick(self) -> None:
        """Nothing new; keeps the watchdog from stopping the arm."""
        self._ask(self._control.kickWatchdog)

    def end(self) -> None:
        """End the program, with the arm at rest."""
        self.stop()
        self._control.stopScript()

    def _ask(self, command: Callable[..., bool], *arguments: object) -> None:
        try:
            done = command(*arguments)
        except RuntimeError as error:  # ur-rtde has tried to connect again
            raise ConnectionError(f"connection lost: {error}") from error
        if not done:
            self._require_samples()
            raise ConnectionError("the program on the controller has ended; is the arm stopped, or in local control?")

    def _require_samples(self) -> None:
        """ConnectionError if they do not go on: of a lost connection ur-rtde may see first that a command failed."""
        before = self.state().robot_time
        time.sleep(_GOES_ON)
        if self.state().robot_time - before < 0.5 * _GOES_ON:
            raise ConnectionError("connection lost: no new sample")


def connect(robot_ip: str, stopping: Stopping, timeout: float = 5.0) -> UrArm:
    """An arm that will move; raises ConnectionError with the reason why it will not.

    timeout [s] of each answer that is awaited here; `ur-rtde` has its own, and may end the process.
    """
    from rtde_control import RTDEControlInterface

    receiver = rtde_connector(timeout)(robot_ip, RATE)
    for port in (DASHBOARD_PORT, SCRIPT_PORT):
        try:
            socket.create_connection((robot_ip, port), timeout).close()
        except OSError as error:
            raise ConnectionError(f"nobody answers at {robot_ip}:{port}: {error}") from error
    try:
        # Without a program: with one, ur-rtde would start it anew when it connects again, and without the watchdog.
        control = RTDEControlInterface(robot_ip, RATE, RTDEControlInterface.FLAG_NO_WAIT)
    except RuntimeError as error:
        raise ConnectionError(f"{robot_ip} takes no commands: {error}") from error
    arm = UrArm(control, receiver, stopping)
    arm.begin(timeout)
    return arm
