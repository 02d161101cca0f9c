"""How a process of nodes ends, whatever it does when a signal stops it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys

import pytest

pytestmark = pytest.mark.dds

PROGRAM = """
import signal, sys, threading
import cv2, numpy as np
from std_msgs.msg import String
from midastouch_common.errors import InputError
from midastouch_common.ros import qos, spin
from midastouch_common.ros.node import PipelineNode

what = sys.argv[1]

def stay(moment):
    if what == "stay":
        print(moment, flush=True)
        sys.stdin.readline()

class Spinner(PipelineNode):
    gave_up = False

    def __init__(self):
        super().__init__("spinner")
        self.create_publisher(String, "talk", qos.COMMAND)
        if what == "fail":
            raise InputError("mesh.ply: no such file; check the path")
        if what == "refuse":
            raise RuntimeError("unusable")
        # as a driver's reader: must not outlive the node, for Python ends badly under a thread that is inside OpenCV
        self.reading = True
        self.thread = threading.Thread(target=self.read, daemon=True)
        self.thread.start()
        self.timer = self.create_timer(0.01, self.work)
        stay("making")
        if what == "while_made":
            signal.raise_signal(signal.SIGINT)

    def read(self):
        image = cv2.imencode(".png", np.zeros((640, 480, 3), np.uint8))[1]
        while self.reading:
            cv2.imdecode(image, cv2.IMREAD_COLOR)

    def work(self):
        self.timer.cancel()
        if what == "break":
            raise RuntimeError("a real error")
        if what == "finish":
            spin.stop()
        if what == "give_up":
            self.gave_up = True
        if what.startswith("SIG"):
            signal.raise_signal(getattr(signal, what))
        stay("working")
        print("idle", flush=True)

    def destroy_node(self):
        stay("ending")
        self.reading = False
        self.thread.join()
        super().destroy_node()

raise SystemExit(spin.run(lambda: [Spinner()]))
"""


def ended(*arguments: str, **options) -> subprocess.CompletedProcess:
    command = ["env", "--default-signal=INT,HUP", sys.executable, "-c", PROGRAM, *arguments]
    return subprocess.run(command, capture_output=True, text=True, **options)


@pytest.mark.parametrize(
    ("moment", "number"),
    [("making", signal.SIGINT), ("working", signal.SIGTERM), ("idle", signal.SIGINT), ("idle", signal.SIGTERM)],
)
def test_told_to_stop_at_any_moment_it_ends_well(moment, number):
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


@pytest.mark.parametrize(
    ("what", "code", "said"),
    [
        ("SIGHUP", 0, ""),
        ("while_made", 0, ""),
        ("finish", 0, ""),
        ("give_up", 1, ""),
        ("fail", 2, "mesh.ply: no such file; check the path"),
    ],
)
def test_exit_codes(what, code, said):
    done = ended(what)
    assert (done.returncode, done.stderr.strip()) == (code, said)


@pytest.mark.parametrize("what", ["refuse", "break"])
def test_errors_of_ours_end_it_with_their_traceback(what):
    done = ended(what)
    assert done.returncode == 1
    assert "Traceback" in done.stderr


def test_an_override_of_a_topic_that_is_not_there_fails_at_start():
    done = ended("finish", "--ros-args", "-p", "qos_overrides./talkk.publisher.depth:=3")
    assert done.returncode == 2
    assert "'qos_overrides./talkk.publisher.depth'" in done.stderr
    assert "qos_overrides./talk.publisher.depth" in done.stderr


@pytest.mark.parametrize(
    ("arguments", "log_folder", "named"),
    [
        (["--params-file", "nowhere.yaml"], "logs", "nowhere.yaml"),
        (["--bogus"], "logs", "--bogus"),
        ([], "a_file/logs", "a_file/logs"),
    ],
)
def test_what_keeps_ros_from_starting_is_said_in_one_line(tmp_path, arguments, log_folder, named):
    (tmp_path / "a_file").touch()
    done = ended("run", "--ros-args", *arguments, env={**os.environ, "ROS_LOG_DIR": str(tmp_path / log_folder)})
    assert done.returncode == 2, done.stderr
    assert "Traceback" not in done.stderr
    assert named in done.stderr.splitlines()[-1]
    assert "ROS_LOG_DIR" in done.stderr.splitlines()[-1]
