"""A signal breaks off whatever a lifecycle node loads: at start, when it is configured later, or while it is active."""

from __future__ import annotations

import signal
import subprocess
import sys

import pytest

pytestmark = pytest.mark.dds

PROGRAM = """
import sys
from midastouch_common.ros import spin
from midastouch_common.ros.managed_node import AUTOSTART, ManagedNode

when = sys.argv[1]

class Loader(ManagedNode):
    def __init__(self, name):
        super().__init__(name, [AUTOSTART])
        self.autostart()
        self.timer = self.create_timer(0.01, self.work)

    def load(self):
        try:
            print("loading", flush=True)
            while True:
                pass
        finally:
            print("broken off", flush=True)

    def configure(self):
        if when != "while active":
            self.load()

    def work(self):
        self.timer.cancel()
        if when == "while active":
            with self.busy("loading another"):
                self.load()
        self.trigger_configure()

    def connect(self):
        print("connected", flush=True)

    def unload(self):
        print("unloaded", flush=True)

    def describe(self):
        return bytes([0]), "", {}

def nodes():
    yield Loader("first")
    print("second", flush=True)

raise SystemExit(spin.run(nodes))
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize(
    ("when", "autostart", "said"),
    [
        ("at start", "true", ["broken off", "unloaded"]),
        ("when configured", "false", ["broken off", "unloaded"]),
        ("while active", "true", ["broken off"]),
    ],
)
def test_loading_that_never_ends_is_broken_off(when, autostart, said, number):
    command = [sys.executable, "-c", PROGRAM, when, "--ros-args", "-p", f"autostart:={autostart}"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        for line in process.stdout:
            if line == "loading\n":
                process.send_signal(number)
                break
        rest, errors = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == 0, errors
    assert rest.splitlines() == said
    assert "Traceback" not in errors
