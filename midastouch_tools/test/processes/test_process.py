"""Where our executables are found, and what they are started with."""

import os
import time
from pathlib import Path

import pytest

from midastouch_common.errors import InputError
from midastouch_tools.processes.process import Process, Program, end, find_executable, node_program


def test_a_node_gets_its_parameters():
    program = node_program("python3", Path("p.yaml"))
    assert program.name == "python3"
    assert program.command[1:] == ("--ros-args", "--params-file", "p.yaml")
    assert not program.ends


def test_a_missing_executable_names_the_mend():
    with pytest.raises(InputError, match=r"'no_such_node'.*run make"):
        node_program("no_such_node", Path("p.yaml"))


def test_those_of_a_sourced_workspace_come_first(tmp_path, monkeypatch):
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"/nowhere:{tmp_path}")
    ours = tmp_path / "lib" / "midastouch_filter" / "python3"
    ours.parent.mkdir(parents=True)
    ours.write_text("#!/bin/sh\n")
    ours.chmod(0o755)
    assert find_executable("python3") == str(ours)


def test_a_node_that_has_not_loaded_yet_is_ended_without_a_traceback(tmp_path):
    (script := tmp_path / "tdn").write_text(
        f"#!/bin/sh\ntrap 'echo traceback' INT\ntrap 'echo ended; exit 0' TERM\n"
        f"touch {tmp_path}/handles\nwhile :; do sleep 0.02; done\n"
    )
    script.chmod(0o755)
    said = []
    process = Process(Program("tdn", (str(script),)), os.environ, lambda _, line: said.append(line))
    while not (tmp_path / "handles").exists():
        assert process.runs
        time.sleep(0.02)
    end([process])
    assert (process.status(), said) == (0, ["ended"])
