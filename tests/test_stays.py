"""The way from the command line to the work stays short for readers."""

import pytest
from stays import stays


def test_run_reaches_its_launch_through_few_functions(monkeypatch, tmp_path):
    pytest.importorskip("launch.on_wheels", reason="a system ROS has another launch service")
    monkeypatch.chdir(tmp_path)
    found = stays(["run", "localization", "object:=handle_tool"])
    assert found[0] == "midastouch_tools.cli:main"
    assert "midastouch_tools.ros.launch_file:carry_out" in found
    assert len(found) <= 23, "inline what has one caller; lower this number with the count"
