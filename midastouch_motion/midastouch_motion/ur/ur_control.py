"""Speeds of a UR arm's TCP, by `ur-rtde`'s program on the controller.

That program continues with the last `speedL` until it gets a stop: the `time` of a `speedL` is only how long the
controller keeps to it before it looks for a newer one. If no commands come any more, the controller's watchdog over the
input registers stops the arm.
"""

from __future__ import annotations

import socket
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .rtde import ArmState, RtdeReceiver, rtde_connector

RATE = 125.0
"""Samples and commands per second; every controller supports this rate."""
DASHBOARD_PORT, SCRIPT_PORT = 29999, 30003
_GOES_ON = 0.1  # s in which samples must advance: then the program has ended, and the connection is not lost


@dataclass(frozen=True)
class Stopping:
    """Acceleration and deceleration of an arm [m/s^2], and the time without a command after which it stops [s]."""

    acceleration: float
    deceleration: float
    timeout: float


class UrArm:
    """An arm that is connected. Its methods raise ConnectionError, with the reason, if it does not obey."""

    def __init__(self, control, receiver: RtdeReceiver, stopping: Stopping):
        self._control, self._receiver, self._stopping = control, receiver, stopping

    def begin(self, timeout: float) -> None:
        """Start the program, within `timeout` [s], in place of any other one.

        The controller ends it, and so stops the arm, whenever no command has come for the timeout of `stopping`.
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
        """Return the newest sample."""
        state = self._receiver.read()
        if state is None or not self._control.isConnected():
            raise ConnectionError("connection lost")
        return state

    def move(self, velocity: np.ndarray) -> None:
        """Move the TCP by a twist (6,) along the axes of `base`; m/s, rad/s."""
        how = self._stopping
        self._ask(self._control.speedL, velocity.tolist(), how.acceleration, how.timeout)

    def stop(self) -> None:
        """Stop, and return once the arm stands still."""
        self._ask(self._control.speedStop, self._stopping.deceleration)

    def kick(self) -> None:
        """Keep the watchdog from stopping the arm, without a new command."""
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
        """Raise ConnectionError if samples do not advance: a lost connection may first show as a failed command."""
        before = self.state().robot_time
        time.sleep(_GOES_ON)
        if self.state().robot_time - before < 0.5 * _GOES_ON:
            raise ConnectionError("connection lost: no new sample")


def connect(robot_ip: str, stopping: Stopping, timeout: float = 5.0) -> UrArm:
    """Connect to an arm and start the program; raises ConnectionError with the reason if the arm will not move.

    timeout [s] of each answer that is awaited here; `ur-rtde` has its own, and may end the process.
    """
    from rtde_control import RTDEControlInterface

    receiver = rtde_connector(timeout)(robot_ip, RATE)
    for port in (DASHBOARD_PORT, SCRIPT_PORT):
        try:
            socket.create_connection((robot_ip, port), timeout).close()
        except OSError as error:
            raise ConnectionError(f"no answer from {robot_ip}:{port}: {error}") from error
    try:
        # Without a program: ur-rtde would start one again when it reconnects, and without the watchdog.
        control = RTDEControlInterface(robot_ip, RATE, RTDEControlInterface.FLAG_NO_WAIT)
    except RuntimeError as error:
        raise ConnectionError(f"{robot_ip} takes no commands: {error}") from error
    arm = UrArm(control, receiver, stopping)
    arm.begin(timeout)
    return arm
