"""How the process ends, whatever the signal interrupts; with a small node in the driver's place."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

pytestmark = pytest.mark.dds

PROGRAM = """
import os, signal, sys, time
from rclpy.node import Node
from digit_driver.errors import InputError
from digit_driver.nodes import spin

class Driver(Node):
    failure = ""

    def __init__(self):
        if "refuse" in sys.argv:
            raise InputError("unusable")
        super().__init__("driver")
        self.create_timer(0.01, self.work)

    def work(self):
        if "give_up" in sys.argv:
            self.failure = "no sensor"
        elif "break" in sys.argv:
            raise RuntimeError("a real error")
        else:
            os.kill(os.getpid(), getattr(signal, sys.argv[1]))
            # As in rclpy's conversions between Python and C: the interrupt ends them, and they say that they failed.
            try:
                time.sleep(0.2)
            except KeyboardInterrupt:
                pass
            raise RuntimeError("Unable to convert call argument to Python object")

raise SystemExit(spin.run(Driver))
"""


@pytest.mark.parametrize(("what", "code"), [("SIGINT", 0), ("SIGTERM", 0), ("give_up", 1), ("refuse", 2), ("break", 1)])
def test_exit_codes(what, code) -> None:
    environment = {**os.environ, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    command = [sys.executable, "-c", PROGRAM, what]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60)
    assert done.returncode == code, done.stderr
    assert ("Traceback" in done.stderr) == (what == "break"), done.stderr
