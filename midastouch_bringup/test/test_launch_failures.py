"""What the launch files refuse before anything is started, and what ends a launch."""

import os
import re
import shlex
import signal
import subprocess
import sys
import types

import pytest
from fake_launch import (
    FACTS,
    FILES,
    OTHERS,
    Command,
    Launched,
    ended,
    installation,
    load,
    perform,
)
from launch_rig import AN_ARM, BOX, carry_out, given_to

from midastouch_common.errors import InputError


@pytest.mark.usefixtures("stand_ins")
def test_an_arm_without_its_calibration_is_warned_of():
    asked = {"object": "ball", "arm": "ur_driver", "robot_ip": "10.0.0.7"}
    launched = Launched()
    without = launched.carry_out("live_ur", **asked)["ur_robot_driver", "launch/ur_control.launch.py"]
    assert "kinematics_params_file" not in without  # what the driver takes by itself is its own affair
    assert "ur_calibration" in launched.said[0]
    launched = Launched()
    calibrated = launched.carry_out("live_ur", **asked, kinematics_params_file="/data/arm.yaml")
    arguments = calibrated["ur_robot_driver", "launch/ur_control.launch.py"]
    assert arguments["kinematics_params_file"] == "/data/arm.yaml"
    launched.carry_out("live_ur", object="ball", arm="ur_driver", use_mock_hardware="true")
    launched.carry_out("live_ur", object="ball")
    assert launched.said == []


@pytest.mark.usefixtures("stand_ins")
@pytest.mark.parametrize("composed", ["false", "true"])
def test_a_filter_without_an_object_is_said_to_wait_for_one(composed):
    launched = Launched()
    launched.carry_out("live_ur", composed=composed)
    (warning,) = launched.said
    assert "particle_filter has no object" in warning
    assert "object:=NAME" in warning


@pytest.mark.usefixtures("stand_ins")
def test_an_object_that_is_not_bundled_is_refused():
    with pytest.raises(InputError, match="sofa: not bundled; there are"):
        carry_out("filter", object="sofa")


@pytest.mark.usefixtures("stand_ins")
def test_a_failed_preparation_ends_the_launch():
    (process,) = (one for one in load("demo").args[0] if type(one).__name__ == "ExecuteProcess")
    context = types.SimpleNamespace(launch_configurations={"object": "handle_tool"}, is_shutdown=False)
    with pytest.raises(RuntimeError, match="midastouch-1 died with exit code 2"):
        process.kwargs["on_exit"](ended(2, "midastouch-1"), context)
    context.is_shutdown = True  # Ctrl-C
    assert process.kwargs["on_exit"](ended(130), context) == []
    assert process.kwargs["on_exit"](ended(0), context) == []


@pytest.mark.usefixtures("stand_ins")
def test_a_misspelt_node_in_a_parameter_file_is_refused_a_strange_one_is_not(tmp_path):
    overlay = tmp_path / "mine.yaml"
    for name, refused in (("partcile_filter", True), ("tdnn", True), ("amcl", False), ("ur_control", False)):
        overlay.write_text(f"{name}: {{ros__parameters: {{seed: 3}}}}")
        if refused:
            with pytest.raises(InputError, match=f"mine.yaml: .*'{name}'.*did you mean "):
                carry_out("filter", params_overlay=str(overlay))
        else:
            carry_out("filter", params_overlay=str(overlay))


# its node prints to the test, and is heard to have begun before its parent is killed
KILLED = """
import os, shlex, signal, subprocess, sys
os.mkfifo(sys.argv[2])
subprocess.Popen(shlex.split(sys.argv[1]))
open(sys.argv[2]).read()
os.kill(os.getpid(), signal.SIGKILL)
"""

WRONG = [
    ("live_ur", {**AN_ARM, "seed": "abc"}, "seed:=abc: must be a whole number"),
    ("live_ur", {**AN_ARM, "object": "sofa"}, "sofa: not bundled"),
    ("live_ur", {**AN_ARM, "params_file": "/nowhere.yaml"}, "/nowhere.yaml: no such parameter file"),
    ("live_ur", {"arm": "rtde"}, "arm:=rtde: at which address"),
    ("live_ur", {"arm": "rtde", "use_mock_hardware": "true"}, "arm:=rtde: at which address"),
    ("live_ur", {"arm": "ur_driver"}, "arm:=ur_driver: at which address"),
    ("explore_ur", {**BOX, "arm": "rtde"}, "arm:=rtde: at which address"),
    ("explore_ur", AN_ARM, "where may the arm move[?] Give box_low and box_high of contact_controller"),
    ("replay", {"rate": "fast"}, "rate:=fast: must be a number"),
    ("demo", {"object": "sofa"}, "sofa: not bundled"),
    *((name, {"params_overlay": "/nowhere.yaml"}, "/nowhere.yaml") for name in ("driver", "filter", "localization")),
]


@pytest.mark.usefixtures("stand_ins")
@pytest.mark.parametrize(("name", "given", "reason"), WRONG)
def test_a_wrong_argument_is_refused_before_anything_is_started(name, given, reason):
    """What was begun before an action raises would go on without launch."""
    assert FACTS["behaviour"]["an action raises after a process was begun"]["leaves"]
    launched = Launched()
    with pytest.raises(InputError, match=reason):
        launched.carry_out(name, **given)
    assert (launched.started, launched.ran) == ({}, [])


@pytest.mark.usefixtures("stand_ins")
def test_a_mount_that_cannot_be_described_is_refused_before_anything_is_started(monkeypatch):
    def fails(line):
        raise RuntimeError(f"executed command failed. Command: {line}")

    monkeypatch.setattr(Command, "ran", staticmethod(fails))
    launched = Launched()
    with pytest.raises(RuntimeError, match="frames_file:=/nowhere"):
        launched.carry_out("live_ur", **AN_ARM, frames_file="/nowhere")
    assert launched.started == {}


@pytest.mark.usefixtures("stand_ins")
@pytest.mark.parametrize("missing", OTHERS)
def test_what_is_not_installed_is_named_before_anything_is_started(missing, tmp_path, monkeypatch):
    there = installation(tmp_path / "less", [package for package in OTHERS if package != missing])
    _with_all, *ours = os.environ["AMENT_PREFIX_PATH"].split(os.pathsep)
    monkeypatch.setenv("AMENT_PREFIX_PATH", os.pathsep.join([there, *ours]))
    launched = Launched()
    fix = f"sudo apt install ros-$ROS_DISTRO-{missing.replace('_', '-')}, or "
    with pytest.raises(InputError, match=f"{missing} .*{re.escape(fix)}"):
        launched.carry_out("live_ur", arm="ur_driver", robot_ip="the.arm")
    assert launched.started == {}


@pytest.mark.usefixtures("stand_ins")
@pytest.mark.parametrize("name", FILES)
def test_a_process_that_dies_for_good_ends_the_launch(name):
    behaviour = FACTS["behaviour"]
    assert behaviour["on_exit raises"] == {"exit": 1, "leaves": False}
    assert behaviour["on_exit returns Shutdown while launch is shutting down"]["exit"] == 1
    # as in the group of another launch file, whose end takes the arguments with it
    running, ending = (types.SimpleNamespace(launch_configurations={}, is_shutdown=end) for end in (False, True))
    for (_, executable), kwargs in carry_out(name, **given_to(name)).items():
        on_exit = kwargs["on_exit"]
        assert on_exit(ended(-2), ending) is None
        if executable == "rviz2":
            assert type(on_exit(ended(0), running)).__name__ == "Shutdown"
        else:
            with pytest.raises(RuntimeError, match="node-1 died with exit code 2: ending all"):
                on_exit(ended(2), running)
    if name not in ("rviz", "demo"):
        for (_, executable), kwargs in carry_out(name, **{**given_to(name), "use_respawn": "true"}).items():
            # not the replay, which would play twice, nor the explorer, nor RViz, which the user has closed
            assert kwargs["respawn"] == (executable not in ("replay", "explorer", "rviz2"))
            if kwargs["respawn"]:
                assert kwargs["on_exit"](ended(-11), running) is None
                with pytest.raises(RuntimeError, match="exit code 2"):  # bad input
                    kwargs["on_exit"](ended(2), running)


@pytest.mark.usefixtures("stand_ins")
@pytest.mark.parametrize("name", FILES)
def test_every_process_has_the_name_of_its_executable(name):
    for (_, executable), kwargs in carry_out(name, **given_to(name)).items():
        assert kwargs["exec_name"] == executable


@pytest.mark.usefixtures("stand_ins")
def test_nodes_end_with_a_launch_that_is_killed(tmp_path):
    """SIGKILL leaves it no time to end its processes; a prefix is put before a command."""
    (prefix,) = {perform(kwargs["prefix"], {}) for kwargs in carry_out("live_ur", **AN_ARM).values()}
    ready = tmp_path / "ready"
    node = f"trap 'echo told; exit' TERM; echo > {ready}; for _ in $(seq 1000); do sleep 0.1; done; echo forgotten"
    command = [sys.executable, "-c", KILLED, f"{prefix} sh -c {shlex.quote(node)}", str(ready)]
    killed = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    # the end of the output is that of the node
    assert killed.communicate(timeout=120)[0] == "told\n"
    assert killed.returncode == -signal.SIGKILL


@pytest.mark.usefixtures("stand_ins")
def test_a_replay_that_has_finished_leaves_the_others_to_be_looked_at():
    on_exit = carry_out("replay")["midastouch_tools", "replay"]["on_exit"]
    said = on_exit(ended(0, "replay-4"), types.SimpleNamespace(is_shutdown=False))
    assert "replay-4" in said.kwargs["msg"]
    assert "Ctrl-C" in said.kwargs["msg"]


@pytest.mark.usefixtures("stand_ins")
def test_a_file_with_another_sensor_than_the_launch_is_refused(tmp_path):
    (tmp_path / "mini.yaml").write_text("tdn: {ros__parameters: {sensor_model: gelsight_mini}}")
    overlay = {"params_overlay": str(tmp_path / "mini.yaml")}
    with pytest.raises(InputError, match=r"mini.yaml: tdn .*gelsight_mini.*digit_real.*sensor_model:=gelsight_mini"):
        carry_out("live_ur", **overlay)
    carry_out("live_ur", sensor_model="gelsight_mini", **overlay)
