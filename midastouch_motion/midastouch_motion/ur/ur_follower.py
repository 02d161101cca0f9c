"""Program that makes a UR arm follow the orders on its standard input.

    python -m midastouch_motion.ur.ur_follower ADDRESS ACCELERATION DECELERATION TIMEOUT

It is a process of its own because `ur-rtde` may end its process, hang for minutes, or reconnect without a report: the
parent process then ends the program. The end of the input stops the arm.
"""

from __future__ import annotations

import contextlib
import dataclasses
import os
import sys
import time
from collections.abc import Callable, Sequence

import numpy as np

from .orders import ALIVE, READY, TROUBLE, Orders
from .rtde import transform_from_rtde
from .tcp_twist import along_base
from .ur_control import RATE, Stopping, UrArm, connect

_LOST = 1.0  # s without a new sample of the arm
_REPORT_PERIOD = 0.1  # s


def command(robot_ip: str, stopping: Stopping) -> list[str]:
    """Return the command line that starts this program.

    Parameters
    ----------
    robot_ip, stopping
    """
    return [sys.executable, "-m", __name__, robot_ip, *map(str, dataclasses.astuple(stopping))]


def follow(arm: UrArm, orders: Orders, timeout: float, report: Callable[[str], None]) -> None:
    """Carry out the newest order; return after the last one, with the arm at rest.

    Parameters
    ----------
    arm, orders
    timeout : largest age of an order, and of the arm's pose [s]
    report
        Called with `ALIVE` once a period.

    Raises
    ------
    ConnectionError
        The arm sends no new samples.
    """
    robot_time, sampled, reported = None, time.monotonic(), -np.inf
    order, moving = None, False
    while True:
        state, now = arm.state(), time.monotonic()
        if state.robot_time != robot_time:
            robot_time, sampled = state.robot_time, now
        elif now - sampled > _LOST:
            raise ConnectionError(f"no new sample for {_LOST:g} s")
        if order is not None and order.twist.any() and now - min(order.sent, sampled) <= timeout:
            arm.move(along_base(order.twist, transform_from_rtde(state.tcp_pose)))
            moving = True
        elif moving:
            arm.stop()
            moving = False
        else:
            arm.kick()
        if now - reported >= _REPORT_PERIOD:
            report(ALIVE)
            reported = now
        try:
            order = orders.wait(1.0 / RATE)
        except EOFError:
            arm.end()
            return


def main(arguments: Sequence[str]) -> None:
    """Run the program and end the process: with code 0 after the last order, with 1 for any other reason."""
    robot_ip, *numbers = arguments
    stopping = Stopping(*map(float, numbers))
    reports = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)  # ur-rtde prints there

    def report(words: str) -> None:
        with contextlib.suppress(OSError):  # the parent is gone: the orders end, too
            reports.write(words + "\n")

    code = 0
    try:
        arm = connect(robot_ip, stopping)
        report(READY)
        follow(arm, Orders(0), stopping.timeout, report)
    except Exception as error:  # ur-rtde may raise anything
        report(f"{TROUBLE} {' '.join(str(error).split())}")
        code = 1
    # Without the destructors of ur-rtde, which wait for a lost connection. The controller stops the arm.
    os._exit(code)


if __name__ == "__main__":
    main(sys.argv[1:])
