"""Commands, make targets and launch files in the documents, against the programs."""

import argparse
import re
import shlex

import pytest
from documents import ALL, LINES, ROOT, SPANS, commands, table

from midastouch_tools.cli import add_commands, build_parser
from midastouch_tools.ros.launch_file import declared, path_of


def test_every_midastouch_command_parses():
    calls = commands("midastouch")
    assert len(calls) > 10
    parser = build_parser()
    for arguments in calls:
        try:
            parser.parse_args(arguments)
        except SystemExit as exit_:
            pytest.fail(f"midastouch {' '.join(arguments)}: exit {exit_.code}")


def test_the_command_table_is_complete():
    described = {shlex.split(row[0].strip("`"))[1] for row in table("docs/commands.md", "## midastouch")}
    assert described == {name for section in add_commands(argparse.ArgumentParser()) for name in section.parsers}


def test_every_make_target_exists():
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), flags=re.M))
    wanted = set(re.findall(r"^make (?:\w+=\S+ )?([a-z-]+)", "\n".join([*LINES, *SPANS]), flags=re.M))
    assert wanted <= targets
    assert {row[0].strip("`").removeprefix("make ") for row in table("docs/commands.md", "## make")} == targets


def test_launch_files_and_their_arguments_exist():
    folder = ROOT / "midastouch_bringup" / "launch"
    described = {row[0].strip("`") for row in table("docs/commands.md", "## ros2 launch midastouch_bringup")}
    assert described == {path.name for path in folder.glob("*.launch.py")}
    for call in commands("ros2"):
        if call[0] == "launch":
            assert call[1] == "midastouch_bringup"
            assert call[2] in described
            for argument in call[3:]:
                assert argument == "--show-args" or argument.partition(":=")[0] in declared(call[2].split(".")[0])
    every = {argument for path in folder.glob("*.launch.py") for argument in declared(path.name.split(".")[0])}
    assert {argument for argument, _ in re.findall(r"`(\w+):=(\w+)`", ALL)} <= every


def test_what_is_run_without_launch_can_be_started():
    calls = [call[1:] for call in commands("midastouch") if call[0] == "run" and call[1].islower()]
    assert calls
    for setup, *words in calls:
        assert path_of(setup)
        assert {word.partition(":=")[0] for word in words if word != "--show-args"} <= declared(setup).keys()
