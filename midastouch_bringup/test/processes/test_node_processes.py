"""Processes are started, watched and stopped; the stand-ins are small shell scripts."""

import stat
import time
from pathlib import Path

import pytest

from midastouch_bringup.processes import node_processes
from midastouch_bringup.processes.node_processes import NodeFailed, NodeProcesses, find_executable
from midastouch_perception.errors import InputError


@pytest.fixture
def program(tmp_path, monkeypatch):
    """Factory of executables on PATH with the given shell lines."""
    folder = tmp_path / "bin"
    folder.mkdir()
    monkeypatch.setenv("PATH", f"{folder}:/usr/bin:/bin")

    def make(name: str, *lines: str) -> str:
        path = folder / name
        path.write_text("\n".join(["#!/bin/sh", *lines, ""]))
        path.chmod(path.stat().st_mode | stat.S_IEXEC)
        return name

    return make


def wait_for(condition, seconds: float = 120.0) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "it did not happen in time"
        time.sleep(0.01)


def log_of(tmp_path: Path, name: str) -> str:
    path = tmp_path / "log" / f"{name}.log"
    return path.read_text() if path.exists() else ""


def test_a_node_gets_its_parameters_and_domain_and_ends_well(program, tmp_path):
    name = program("h_env", 'echo "$ROS_DOMAIN_ID $ROS_AUTOMATIC_DISCOVERY_RANGE $*"')
    with NodeProcesses(tmp_path / "log", 37) as processes:
        processes.start(name, Path("p.yaml"))
        wait_for(lambda: not processes.running(name))
    assert log_of(tmp_path, name) == "37 LOCALHOST --ros-args --params-file p.yaml\n"


def test_a_node_that_fails_is_reported_with_the_end_of_its_log(program, tmp_path):
    name = program("h_fail", "seq 100", "echo no such mesh >&2", "exit 3")
    with NodeProcesses(tmp_path / "log", 37) as processes:
        processes.start(name, Path("p.yaml"))
        with pytest.raises(NodeFailed, match="h_fail ended with status 3") as caught:
            wait_for(lambda: not processes.running(name))
    assert "no such mesh" in str(caught.value)
    assert "\n  5\n" not in str(caught.value)


def test_a_node_that_ends_too_early_is_a_failure_too(program, tmp_path):
    name = program("h_early", "exit 0")
    with NodeProcesses(tmp_path / "log", 37) as processes:
        processes.start(name, Path("p.yaml"))
        wait_for(lambda: not processes.running(name))
        with pytest.raises(NodeFailed, match="h_early ended too early"):
            processes.check(name)


@pytest.mark.parametrize(
    ("heard", "seconds"), [("trap 'echo bye; exit 0' INT", 600.0), ("trap 'echo bye; exit 0' TERM; trap '' INT", 0.05)]
)
def test_nodes_are_asked_before_they_are_killed(program, tmp_path, monkeypatch, heard, seconds):
    monkeypatch.setattr(node_processes, "_GRACE_S", (seconds, 600.0, 600.0))
    name = program("h_polite", heard, "echo ready", "while :; do sleep 0.05; done")
    processes = NodeProcesses(tmp_path / "log", 37)
    processes.start(name, Path("p.yaml"))
    wait_for(lambda: log_of(tmp_path, name))
    processes.stop()
    assert log_of(tmp_path, name) == "ready\nbye\n"
    assert not processes.running(name)


def test_nodes_that_do_not_listen_are_killed(program, tmp_path, monkeypatch):
    monkeypatch.setattr(node_processes, "_GRACE_S", (0.05, 0.05, 600.0))
    name = program("h_deaf", "trap '' INT TERM", "echo ready", "while :; do sleep 0.05; done")
    processes = NodeProcesses(tmp_path / "log", 37)
    processes.start(name, Path("p.yaml"))
    wait_for(lambda: log_of(tmp_path, name))
    processes.stop()
    with pytest.raises(NodeFailed, match="status -9"):
        processes.running(name)


def test_what_has_ended_is_started_again_and_its_log_goes_on(program, tmp_path):
    dead = program("h_dead", "echo one life", "exit 3")
    alive = program("h_alive", "while :; do sleep 0.05; done")
    with NodeProcesses(tmp_path / "log", 37) as processes:
        for name in (dead, alive):
            processes.start(name, Path("p.yaml"))
        before = processes.pids
        wait_for(lambda: processes.revive() == [dead])
        wait_for(lambda: log_of(tmp_path, dead) == "one life\none life\n")
        assert processes.pids[alive] == before[alive]
        assert processes.pids[dead] != before[dead]


def test_a_missing_executable_names_the_mend(tmp_path):
    with pytest.raises(InputError, match="'no_such_node' is not installed; run make"):
        NodeProcesses(tmp_path, 37).start("no_such_node", Path("p.yaml"))


def test_those_of_a_sourced_workspace_come_first(tmp_path, monkeypatch):
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"/nowhere:{tmp_path}")
    ours = tmp_path / "lib" / "midastouch_filter" / "python3"
    ours.parent.mkdir(parents=True)
    ours.write_text("#!/bin/sh\n")
    ours.chmod(0o755)
    assert find_executable("python3") == str(ours)


def test_executables_beside_python_are_found():
    assert Path(find_executable("python3")).exists()
