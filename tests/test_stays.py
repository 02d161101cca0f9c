"""The way from `midastouch run` to its work stays short for readers; test_workflow.py has the commands that measure."""

import pytest
from stays import stays


def test_run_reaches_its_launch_through_few_functions(monkeypatch, tmp_path):
    pytest.importorskip("launch.on_wheels", reason="a system ROS has another launch service")
    monkeypatch.chdir(tmp_path)
    found = stays(["run", "localization", "objects:=handle_tool"])
    assert [name.rpartition(".")[2] for name, waits in found.items() if waits] == [
        "cli:main", "run:run", "run:run_setup", "launch_file:carry_out"
    ]  # fmt: skip
    assert len(found) <= 12, "inline what has one caller; lower this number with the count"
