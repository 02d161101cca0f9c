"""How a process of nodes ends, whatever it does when it is told to."""

from __future__ import annotations

import signal
import subprocess
import sys

import pytest

pytestmark = pytest.mark.dds

PROGRAM = """
import sys
from std_msgs.msg import String
from midastouch_common.errors import InputError
from midastouch_common.ros import qos, spin
from midastouch_common.ros.node import PipelineNode

def stay(moment):
    print(moment, flush=True)
    sys.stdin.readline()

class Spinner(PipelineNode):
    def __init__(self):
        super().__init__("spinner")
        self.create_publisher(String, "talk", qos.COMMAND)
        if "fail" in sys.argv:
            raise InputError("mesh.ply: no such file; check the path")
        self.timer = self.create_timer(0.01, self.work)
        if "stay" in sys.argv:
            stay("making")

    def work(self):
        self.timer.cancel()
        if "break" in sys.argv:
            raise RuntimeError("a real error")
        if "finish" in sys.argv:
            spin.stop()
        if "stay" in sys.argv:
            stay("working")
            print("idle", flush=True)

    def destroy_node(self):
        if "stay" in sys.argv:
            stay("ending")
        super().destroy_node()

raise SystemExit(spin.run(lambda: [Spinner()]))
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("moment", ["making", "working", "idle"])
def test_told_to_stop_at_any_moment_and_again_meanwhile_it_ends_well(moment, number):
    pipes = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE)
    process = subprocess.Popen([sys.executable, "-c", PROGRAM, "stay"], text=True, bufsize=1, **pipes)
    try:
        for line in process.stdout:
            if line.strip() in (moment, "ending"):
                process.send_signal(number)
            if line != "idle\n":
                process.stdin.write("\n")
            if line == "ending\n":
                break
        _, errors = process.communicate()
    finally:
        process.kill()
    assert line == "ending\n"
    assert (process.returncode, errors) == (0, "")


@pytest.mark.parametrize(("what", "code"), [("fail", 2), ("break", 1), ("finish", 0)])
def test_exit_codes(what, code):
    done = subprocess.run([sys.executable, "-c", PROGRAM, what], capture_output=True, text=True)
    assert done.returncode == code, done.stderr
    assert ("Traceback" in done.stderr) == (what == "break"), done.stderr
    assert (done.stderr.strip() == "mesh.ply: no such file; check the path") == (what == "fail")


def test_an_override_of_a_topic_that_is_not_there_fails_at_start():
    misspelt = "qos_overrides./talkk.publisher.depth:=3"
    command = [sys.executable, "-c", PROGRAM, "--ros-args", "-p", misspelt]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 2
    assert "no parameter 'qos_overrides./talkk.publisher.depth'" in done.stderr
    assert "qos_overrides./talk.publisher.depth" in done.stderr
