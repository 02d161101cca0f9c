"""How the process ends, whatever the driver does when it is told to; with a small node in the driver's place."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

pytestmark = pytest.mark.dds

PROGRAM = """
import signal, sys, threading
import cv2, numpy as np
from rclpy.node import Node
from midastouch_common.ros.spin import spin_nodes

class Driver(Node):
    gave_up = False

    def __init__(self):
        if "refuse" in sys.argv:
            raise ValueError("unusable")
        super().__init__("driver")
        self.create_timer(0.01, self.work)
        # like the reader's: forbidden to outlive the node, for Python ends badly under a thread that is inside OpenCV
        self.reading = True
        self.thread = threading.Thread(target=self.read, daemon=True)
        self.thread.start()
        if "while_made" in sys.argv:
            signal.raise_signal(signal.SIGINT)

    def read(self):
        image = cv2.imencode(".png", np.zeros((640, 480, 3), np.uint8))[1]
        while self.reading:
            cv2.imdecode(image, cv2.IMREAD_COLOR)

    def work(self):
        if "give_up" in sys.argv:
            self.gave_up = True
        elif "break" in sys.argv:
            raise RuntimeError("a real error")
        elif sys.argv[1].startswith("SIG"):
            signal.raise_signal(getattr(signal, sys.argv[1]))

    def destroy_node(self):
        self.reading = False
        self.thread.join()
        super().destroy_node()

raise SystemExit(spin_nodes(lambda: [Driver()]))
"""


@pytest.mark.parametrize(
    ("what", "code"),
    [("SIGINT", 0), ("SIGTERM", 0), ("SIGHUP", 0), ("while_made", 0), ("give_up", 1), ("refuse", 1), ("break", 1)],
)
def test_exit_codes(what, code) -> None:
    command = ["env", "--default-signal=INT,HUP", sys.executable, "-c", PROGRAM, what]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == code, done.stderr
    assert ("Traceback" in done.stderr) == (what in ("refuse", "break")), done.stderr


@pytest.mark.parametrize(
    ("arguments", "log_folder", "words"),
    [
        (["--params-file", "nowhere.yaml"], "logs", "nowhere.yaml"),
        (["--bogus"], "logs", "--bogus"),
        ([], "a_file/logs", "a_file/logs"),
    ],
)
def test_what_keeps_ros_from_starting_is_said_in_one_line(tmp_path, arguments, log_folder, words) -> None:
    (tmp_path / "a_file").touch()
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, "run", "--ros-args", *arguments],
        env={**os.environ, "ROS_LOG_DIR": str(tmp_path / log_folder)},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 2, done.stderr
    assert "Traceback" not in done.stderr
    assert words in done.stderr.splitlines()[-1]
    assert "ROS_LOG_DIR" in done.stderr.splitlines()[-1]
