"""The program ur_controller.py, at an address of this run of the tests: its ports are the controller's own."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from midastouch_motion.ur.rtde import transform_from_rtde

ADDRESS = f"127.0.0.{os.environ['ROS_DOMAIN_ID']}"
BASE_FROM_TCP = transform_from_rtde(np.array([0.3, -0.2, 0.4, 0.1, 2.6, -0.2]))
"""What the controller sends."""


class ControllerProcess:
    """One that runs until it is ended. Attribute: events, what it has said so far, a dictionary each."""

    def __init__(self, fault: str = ""):
        command = [sys.executable, Path(__file__).with_name("ur_controller.py"), ADDRESS, fault]
        self._process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        if "ready" not in self._process.stdout.readline():
            pytest.skip(f"its ports are taken: {self._process.communicate()[1].splitlines()[-1]}")
        self.events: list[dict] = []
        self._listener = threading.Thread(target=self._listen)
        self._listener.start()

    def _listen(self) -> None:
        for line in self._process.stdout:
            self.events.append(json.loads(line))

    def said(self, word: str) -> list:
        """What it said under this word."""
        return [event[word] for event in [*self.events] if word in event]

    def end(self) -> None:
        """As if it was switched off."""
        self._process.kill()
        self._listener.join()
        self._process.communicate()


def until(condition: Callable[[], object]):
    """Wait for it and return it; AssertionError if it does not come."""
    end = time.monotonic() + 120.0  # bounds a failing test only
    while not (value := condition()):
        assert time.monotonic() < end, "the awaited event did not come"
        time.sleep(0.01)
    return value
