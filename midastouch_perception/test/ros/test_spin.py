from __future__ import annotations

import signal
import subprocess
import sys

import pytest

pytestmark = pytest.mark.dds

PROGRAM = """
import sys
from rclpy.node import Node
from midastouch_perception.errors import InputError
from midastouch_perception.ros import spin

def nodes():
    if "fail" in sys.argv:
        raise InputError("mesh.ply: no such file; check the path")
    node = Node("spinner")
    node.create_timer(0.01, lambda: print("spinning", flush=True))
    return [node]

raise SystemExit(spin.run(nodes))
"""


@pytest.mark.parametrize("stop", [signal.SIGINT, signal.SIGTERM])
def test_signals_end_a_node_cleanly(stop):
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        assert process.stdout.readline() == "spinning\n"
        process.send_signal(stop)
        _, errors = process.communicate(timeout=20)
    finally:
        process.kill()
    assert process.returncode == 0, errors
    assert "Traceback" not in errors


def test_bad_input_is_one_line_and_exit_code_2():
    done = subprocess.run([sys.executable, "-c", PROGRAM, "fail"], capture_output=True, text=True, timeout=30)
    assert done.returncode == 2
    assert done.stderr.strip() == "mesh.ply: no such file; check the path"
