"""`midastouch store-mount` beside a filter that has learnt something."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from geometry_msgs.msg import Point, Pose, PoseWithCovariance, Quaternion

from midastouch_bringup import cli
from midastouch_bringup.arm.mount import read_mount
from midastouch_bringup.ros.local_context import learnt_calibration
from midastouch_common.errors import InputError
from midastouch_common.ros import qos
from midastouch_msgs.msg import ArmCalibration

pytestmark = pytest.mark.dds

SHIPPED = Path(__file__).parents[2] / "config" / "frames.yaml"


def publish(graph, known: list[bool]) -> None:
    pose = Pose(position=Point(x=0.002), orientation=Quaternion(w=1.0))
    message = ArmCalibration(mount=PoseWithCovariance(pose=pose), clock_offset=0.05, known=known, touches=60)
    graph.companion.create_publisher(ArmCalibration, "calibration", qos.latched()).publish(message)


def test_the_mount_is_stored_and_what_is_unknown_named(graph, tmp_path, capsys):
    publish(graph, [True, True, False, True, True, True, True])
    assert cli.main(["store-mount", "--out", str(tmp_path / "frames.yaml")]) == 0
    said = capsys.readouterr().out
    assert "2.0 mm, 0.0 deg off" in said
    assert "not known yet, of the gel frame: z\n" in said
    assert "50 ms late" in said
    assert "50000000 to the parameter timestamp_offset" in said
    stored, shipped = (read_mount(path)[0][2] for path in (tmp_path / "frames.yaml", SHIPPED))
    np.testing.assert_allclose(stored[:3, 3] - shipped[:3, 3], [0.002, 0, 0], atol=1e-6)


def test_nothing_is_stored_before_something_is_known(graph, tmp_path, capsys):
    publish(graph, [False] * 7)
    assert cli.main(["store-mount", "--out", str(tmp_path / "frames.yaml")]) == 2
    assert "slide over edges" in capsys.readouterr().err
    assert not (tmp_path / "frames.yaml").exists()


def test_a_topic_that_nobody_publishes_is_named(graph):
    with pytest.raises(InputError, match=r"/left/calibration.*--namespace"):
        learnt_calibration("left", timeout=0.2)


def test_a_namespace_that_is_none_is_refused():
    with pytest.raises(InputError, match=r"--namespace a b: .*alphanumerics"):
        learnt_calibration("a b", timeout=0.2)


def test_where_ros_does_not_start_that_is_said(tmp_path):
    (tmp_path / "a_file").touch()
    done = subprocess.run(
        [sys.executable, "-m", "midastouch_bringup.cli", "store-mount", "--out", str(tmp_path / "frames.yaml")],
        env={**os.environ, "ROS_LOG_DIR": str(tmp_path / "a_file" / "logs")},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 2, done.stderr
    assert done.stderr.splitlines()[-1].startswith("midastouch: error: ROS does not start: ")
    assert "Traceback" not in done.stderr


def test_once_stored_it_has_to_be_said_what_the_filter_was_started_with(graph, tmp_path, capsys):
    publish(graph, [True] * 7)
    stored, x = str(tmp_path / "frames.yaml"), []
    for frames in ([], ["--frames", str(SHIPPED)], ["--frames", stored]):
        assert cli.main(["store-mount", "--out", stored, *frames]) == 0
        x.append(read_mount(stored)[0][2][0, 3])
    assert np.diff(x) == pytest.approx([0, 0.002], abs=1e-6)
    assert cli.main(["store-mount", "--out", stored]) == 2
    assert f"--frames {stored}, or --frames " in capsys.readouterr().err
