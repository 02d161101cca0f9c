from __future__ import annotations

import signal
import subprocess
import sys

import pytest

pytestmark = pytest.mark.dds

PROGRAM = """
import sys
from std_msgs.msg import String
from midastouch_perception.errors import InputError
from midastouch_perception.ros import qos, spin
from midastouch_perception.ros.node import PipelineNode

def nodes():
    if "fail" in sys.argv:
        raise InputError("mesh.ply: no such file; check the path")
    node = PipelineNode("spinner")
    node.create_publisher(String, "talk", qos.COMMAND)
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


def test_an_override_of_a_topic_that_is_not_there_fails_at_start():
    misspelt = "qos_overrides./talkk.publisher.depth:=3"
    command = [sys.executable, "-c", PROGRAM, "--ros-args", "-p", misspelt]
    done = subprocess.run(command, capture_output=True, text=True, timeout=30)
    assert done.returncode == 2
    assert "no parameter 'qos_overrides./talkk.publisher.depth'" in done.stderr
    assert "qos_overrides./talk.publisher.depth" in done.stderr
