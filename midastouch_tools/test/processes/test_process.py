"""Where our executables are found, and what they are started with."""

from pathlib import Path

import pytest

from midastouch_common.errors import InputError
from midastouch_tools.processes.process import find_executable, node_program


def test_a_node_gets_its_parameters_and_options():
    program = node_program("python3", Path("p.yaml"), ["--log-level", "warn"])
    assert program.name == "python3"
    assert program.command[1:] == ("--ros-args", "--params-file", "p.yaml", "--log-level", "warn")
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


def test_executables_beside_python_are_found():
    assert Path(find_executable("python3")).exists()
