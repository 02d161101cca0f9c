"""The command line as a user meets it: help, exit codes, one-line errors."""

import argparse
import importlib.metadata
import re

import pytest

from midastouch_common.errors import InputError
from midastouch_tools import cli
from midastouch_tools.commands import doctor, plugins
from midastouch_tools.progress import progress_bar


def commands() -> dict[str, argparse.ArgumentParser]:
    """The parsers of all commands, by name."""
    sections = cli.add_commands(argparse.ArgumentParser())
    return {name: parser for section in sections for name, parser in section.parsers.items()}


COMMANDS = commands()


@pytest.mark.parametrize("name", COMMANDS)
def test_help_shows_an_example_that_parses(name, capsys):
    with pytest.raises(SystemExit) as caught:
        cli.main([name, "--help"])
    assert caught.value.code == 0
    text = capsys.readouterr().out
    example = text.split("example:")[1].strip().splitlines()[-1].split()
    assert example[0] == "midastouch"
    args = cli.build_parser().parse_args(example[1:])
    assert callable(args.run)


class Explained(argparse.HelpFormatter):
    """Refuses what has no help."""

    def add_argument(self, action):
        assert action.help, action.dest


@pytest.mark.parametrize("name", COMMANDS)
def test_every_option_is_explained(name, monkeypatch):
    monkeypatch.setattr(COMMANDS[name], "formatter_class", Explained)
    COMMANDS[name].format_help()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["evaluate", "no/such/seq"], "no/such/seq: "),
        (["evaluate-gel", "--objects", "no_such_object"], "no_such_object"),
        (["evaluate-tdn", "no/such/seq"], "no/such/seq"),
        (["evaluate-presses", "no/such/folder", "--ball-diameter", "0.006"], "no/such/folder: "),
        (["evaluate-checks", "no/such/folder"], "no/such/folder: 0 no-contact images"),
        (["simulate", "no_such_mesh", "--out", "x"], "no_such_mesh: "),
        (["simulate", "no/mesh.ply", "--out", "x"], "no/mesh.ply"),
        (["build-codebook", "no/mesh.ply"], "no/mesh.ply"),
        (["to-bag", "no/such/seq", "--out", "x.mcap"], "no/such/seq"),
        (["replay", "no/such/bag"], "no/such/bag"),
        (["time-offset", "no/such.mcap"], "error: no/such.mcap: not a bag"),
        (["report", "no/such.json", "--out", "x"], "no/such.json: "),
        (["demo", "--object", "teapot"], "--object teapot: not bundled; there are "),
        (["single-touch", "--codebook", "no/book.npz"], "no/book.npz"),
        (["import-weights", "no/net.pth.tar"], "no/net.pth.tar: "),
        (["train-tdn", "--resume", "no/checkpoint"], ""),
    ],
)
def test_bad_input_is_one_line_and_status_2(arguments, message, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert cli.main(arguments) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("midastouch: error: ")
    assert message in lines[0]
    assert list(tmp_path.iterdir()) == []  # nothing half-written


@pytest.mark.parametrize(
    "arguments",
    [
        ["fly"],
        ["evaluate"],
        ["evaluate", "seq", "--seeds", "0"],
        ["evaluate", "seq", "--beta", "-1"],
        ["evaluate", "seq", "--init", "lucky"],
        ["evaluate", "seq", "--json", __file__ + "/out.json"],
        ["simulate", "mesh.ply", "--out", "x", "--length", "nan"],
    ],
)
def test_bad_options_are_status_2(arguments, capsys):
    with pytest.raises(SystemExit) as caught:
        cli.main(arguments)
    assert caught.value.code == 2
    assert "usage:" in capsys.readouterr().err


def test_without_arguments_too_the_help_lists_each_command_once(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "70")
    with pytest.raises(SystemExit) as caught:
        cli.main(["--help"])
    assert caught.value.code == 0
    text = capsys.readouterr().out
    commands_part = text.split("use:")[1].split("options:")[0]
    assert max(map(len, commands_part.splitlines())) <= 68
    listed = re.findall(r"^  ([a-z-]+) +\S", commands_part, flags=re.M)
    assert sorted(listed) == sorted(COMMANDS)
    assert cli.main([]) == 2
    assert capsys.readouterr().err == text


def test_the_version_is_that_of_the_package(capsys):
    with pytest.raises(SystemExit) as caught:
        cli.main(["--version"])
    assert caught.value.code == 0
    assert capsys.readouterr().out == f"midastouch {importlib.metadata.version('midastouch_tools')}\n"


@pytest.mark.parametrize(
    ("error", "status", "line"),
    [
        (InputError("file.ply: is\nbroken"), 2, "midastouch: error: file.ply: is broken"),
        (FileNotFoundError(2, "No such file", "a.png"), 2, "midastouch: error: a.png: No such file or directory"),
        (PermissionError(13, "Permission denied", "/x"), 2, "midastouch: error: /x: Permission denied"),
        (
            FileExistsError(17, "File exists", "a"),
            2,
            "midastouch: error: a: exists and is no folder; choose another place",
        ),
        (
            ModuleNotFoundError(name="midastouch_tools.ros"),
            2,
            "midastouch: error: doctor: this needs ROS 2, and there is no module midastouch_tools.ros; "
            "source a ROS 2 and its workspace, or run make in a clone",
        ),
        (KeyboardInterrupt(), 130, "midastouch: interrupted"),
    ],
)
def test_what_can_go_wrong_while_a_command_runs(error, status, line, monkeypatch, capsys):
    def fail(args):
        raise error

    monkeypatch.setattr(doctor, "run", fail)
    assert cli.main(["doctor"]) == status
    assert capsys.readouterr().err.splitlines() == [line]


def test_an_error_begins_a_line_although_a_progress_bar_is_open(monkeypatch, capsys):
    def fail(args):
        for _ in progress_bar(iterable=range(3), unit="step"):
            raise InputError("a.png: is broken")

    monkeypatch.setattr(doctor, "run", fail)
    assert cli.main(["doctor"]) == 2
    *bar, error, rest = capsys.readouterr().err.split("\n")
    assert any("step" in line for line in bar)
    assert (error, rest) == ("midastouch: error: a.png: is broken", "")


def test_benchmark_commands_name_their_package_if_it_is_missing(monkeypatch, capsys):
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda group: [])
    assert set(cli.OF_BENCHMARK) == COMMANDS.keys() - commands().keys()
    for name in cli.OF_BENCHMARK:
        assert cli.main([name, "--help"]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert f"{name}: comes with the package midastouch_benchmark" in line
        assert "colcon build" in line


@pytest.mark.parametrize(
    ("module", "problem"),
    [("no_such_module", "ModuleNotFoundError: No module named 'no_such_module'"), ("math", "AttributeError: ")],
)
def test_a_command_that_fails_to_import_says_so_and_others_work(module, problem, monkeypatch, capsys):
    broken = importlib.metadata.EntryPoint("of_others", module, plugins.PLUGINS)
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda group: [broken])
    for options in ([], ["--help"], ["--out", "x"]):
        assert cli.main(["of-others", *options]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert f"of-others: cannot be loaded, {problem}" in line
        assert "midastouch doctor" in line
    with pytest.raises(SystemExit) as caught:
        cli.main(["--help"])
    assert caught.value.code == 0
    cli.main(["doctor"])
    assert f"midastouch of-others: {problem}" in capsys.readouterr().out
