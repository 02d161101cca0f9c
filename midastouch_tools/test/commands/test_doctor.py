import re

import pytest

from midastouch_tools import cli, machine
from midastouch_tools.commands import doctor


def test_a_complete_installation_is_ready(capsys):
    assert cli.main(["doctor"]) == 0
    output = capsys.readouterr().out
    assert "ready: midastouch demo" in output
    assert "MISSING" not in output
    assert re.search(r"^ROS 2 (Jazzy|Kilted) \(rclpy \d.*\): tested$", output, flags=re.M)


@pytest.mark.parametrize(
    ("version", "said"),
    [
        ("3.3.21", "ROS 2 Humble (rclpy 3.3.21): not supported"),
        ("10.0.9", "ROS 2 Lyrical (rclpy 10.0.9): read, not tested"),
        ("31.4.0", "ROS 2 with rclpy 31.4.0: unknown here"),
    ],
)
def test_a_distribution_that_was_not_tested_is_said_to_be_so(monkeypatch, capsys, version, said):
    of_the_system = {"rclpy": version}
    monkeypatch.setattr(machine, "package_version", of_the_system.get)
    assert cli.main(["doctor"]) == 0
    assert f"\n{said}" in capsys.readouterr().out


def test_a_missing_part_is_named_with_its_fix(monkeypatch, capsys):
    parts = (("no_such_module", "no-such", "nothing", True, "make setup"), *doctor.MODULES[:2])
    monkeypatch.setattr(doctor, "MODULES", parts)
    assert cli.main(["doctor"]) == 1
    output = capsys.readouterr().out
    assert "no-such: ModuleNotFoundError" in output
    assert "fix: make setup" in output


def test_optional_parts_may_be_absent(monkeypatch, capsys):
    monkeypatch.setattr(doctor, "MODULES", (("no_such_module", "no-such", "nothing", False, "pip"),))
    assert cli.main(["doctor"]) == 0
    assert "if wanted: pip" in capsys.readouterr().out
