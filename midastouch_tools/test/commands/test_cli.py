"""The command line as a user meets it: help, exit codes, one-line errors."""

import argparse
import importlib.metadata
import os
import re
import signal

import pytest

from midastouch_common.errors import InputError
from midastouch_tools import cli
from midastouch_tools.commands import doctor, plugins
from midastouch_tools.progress import progress_bar

COMMANDS = cli.command_parsers()


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


class Listed(argparse.HelpFormatter):
    """Lists the options that a parser explains."""

    def __init__(self, prog: str):
        super().__init__(prog)
        self.actions: list[argparse.Action] = []

    def add_argument(self, action):
        self.actions.append(action)


def explained(name: str) -> list[argparse.Action]:
    """The options and arguments of a command."""
    formatter = Listed(name)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(COMMANDS[name], "formatter_class", lambda prog: formatter)
        COMMANDS[name].format_help()
    return formatter.actions


def takes(action: argparse.Action, text: str) -> str:
    """Why an option refuses a value; empty if it takes it."""
    try:
        action.type(text)
    except (argparse.ArgumentTypeError, ValueError) as error:
        return str(error) or "refused"
    return ""


def status(arguments: list[str]) -> int:
    """The exit status of a command."""
    try:
        return cli.main(arguments)
    except SystemExit as ended:
        return int(ended.code or 0)


NUMBERS = [
    (name, action)
    for name in COMMANDS
    for action in explained(name)
    if action.option_strings
    and action.type
    and not (action.choices or isinstance(action.default, str | os.PathLike))
    and takes(action, "no number")
]


@pytest.mark.parametrize(("name", "action"), NUMBERS, ids=[f"{n}{a.option_strings[0]}" for n, a in NUMBERS])
def test_every_number_has_limits_and_says_why(name, action):
    for text in ("1e30", "9" * 30, "inf", "nan", "-1"):
        assert re.fullmatch(rf"'{text}' is not a (whole )?number (from|above) \d+ .*\d \(.*\)", takes(action, text))
    assert action.default is None or not takes(action, str(action.default))


def test_all_kinds_of_numbers_are_among_them():
    asked = {option for _, action in NUMBERS for option in action.option_strings}
    assert asked >= {"--size", "--length", "--rate", "--seed", "--jobs", "--port", "--ball-diameter", "--domain"}
    assert len(NUMBERS) > 60


@pytest.mark.parametrize(
    ("words", "names"),
    [
        (["foxglove", "--out", "a.json", "--namespace"], ["a b", "2nd", "a//b", "a/2", "a__b", "\u00fc", "..", "a\n"]),
        (["capture-background", "--namespace"], ["a b"]),
        (["view", "--namespace"], ["a b"]),
        (["calibrate", "--ball-diameter", "0.006", "--namespace"], ["a b"]),
        (["calibrate", "--ball-diameter", "0.006", "--serial"], ["../../etc", "a b", ".", "D" * 65]),
        (["export", "a.mcap", "--format", "hdf5", "--out", "a", "--image-topic"], ["a b", "/", "image-raw", "/a/"]),
        (["time-offset", "a.mcap", "--base-frame"], ["a b", "tool\t0"]),
        (["time-offset", "a.mcap", "--gel-frame"], ["a b"]),
    ],
    ids=" ".join,
)
def test_names_that_can_be_none_are_refused(words, names, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for name in names:
        assert status([*words, name]) == 2
        said = capsys.readouterr().err
        shown = name.replace("\n", " ")  # an error is one line
        assert f"argument {words[-1]}: the name '{shown}': not a " in said
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("place", ["/dev/null/x", "/proc/x", "file/x", "x" * 300])
@pytest.mark.parametrize(
    "words",
    [
        ["simulate", "handle_tool", "--out"],
        ["demo", "--out"],
        ["build-codebook", "handle_tool", "--out"],
        ["build-codebook", "handle_tool", "eyebolt", "--out"],
        ["calibrate", "presses", "--ball-diameter", "0.006", "--out"],
        ["calibrate", "presses", "--ball-diameter", "0.006", "--serial", "D20123", "--page"],
        ["calibrate", "presses", "--ball-diameter", "0.006", "--serial", "D20123", "--optics"],
        ["export", "run.mcap", "--format", "hdf5", "--out"],
        ["to-bag", "sequence", "--out"],
        ["foxglove", "--out"],
        ["import-weights", "weights.pth", "--out"],
        ["train-tdn", "--out"],
        ["download", "ycb-mesh", "025_mug", "--out"],
        ["report", "result.json", "--out"],
        ["benchmark", "--out"],
        ["evaluate-motion", "--out"],
    ],
    ids=" ".join,
)
def test_a_place_where_nothing_can_be_written_is_found_before_the_work(words, place, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").touch()
    assert status([*words, place]) == 2
    *_, line = capsys.readouterr().err.splitlines()
    wrong = rf"(error|{words[-1]}): {place}\S*: no (file|folder).* can be written there \(.*\); name another"
    assert re.search(wrong, line)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


@pytest.mark.parametrize("name", COMMANDS)
def test_every_option_is_explained(name):
    assert [action.dest for action in explained(name) if not action.help] == []


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["evaluate", "no/such/seq"], "no/such/seq: "),
        (["evaluate-gel", "--objects", "no_such_object"], "no_such_object"),
        (["evaluate-tdn", "no/such/seq"], "no/such/seq"),
        (["evaluate-presses", "no/such/folder", "--ball-diameter", "0.006"], "no/such/folder: "),
        (["evaluate-checks", "no/such/folder"], "no/such/folder: no such folder; give a folder of no-contact images"),
        (["simulate", "no_such_mesh", "--out", "x"], "no_such_mesh: "),
        (["simulate", "no/mesh.ply", "--out", "x"], "no/mesh.ply"),
        (["build-codebook", "no/mesh.ply"], "no/mesh.ply"),
        (["to-bag", "no/such/seq", "--out", "x.mcap"], "no/such/seq"),
        (["replay", "no/such/bag"], "no/such/bag"),
        (["time-offset", "no/such.mcap"], "error: no/such.mcap: no such file"),
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
    ("arguments", "named"),
    [
        (["fly"], "fly"),
        (["evaluate"], "SEQ"),
        (["evaluate", "seq", "--init", "lucky"], "--init"),
        (["evaluate", "seq", "--json", __file__ + "/out.json"], "--json"),
        (["calibrate", "presses", "--serial", "D20123"], "--ball-diameter"),
        (["build-codebook", "ball", "--size", "0"], "--size: '0' is not a whole number from 1 to 2,000,000"),
        (["import-weights", "a.npz", "--voxel-size", "0"], "--voxel-size: '0' is not a number above 0 and up to 2"),
    ],
)
def test_bad_options_are_status_2(arguments, named, capsys):
    with pytest.raises(SystemExit) as caught:
        cli.main(arguments)
    assert caught.value.code == 2
    *usage, error = capsys.readouterr().err.splitlines()
    assert usage[0].startswith("usage:")
    assert named in error


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
        (signal.SIGINT, 130, "midastouch: interrupted"),
        (signal.SIGTERM, 143, "midastouch: interrupted"),
        (signal.SIGHUP, 129, "midastouch: interrupted"),
    ],
)
@pytest.mark.usefixtures("signals_are_heard")
def test_what_can_go_wrong_while_a_command_runs(error, status, line, monkeypatch, capsys):
    def fail(args):
        if isinstance(error, signal.Signals):
            signal.raise_signal(error)
        raise error

    monkeypatch.setattr(doctor, "run", fail)
    assert cli.main(["doctor"]) == status
    assert capsys.readouterr().err.splitlines() == [line]


def test_an_error_begins_a_line_although_a_progress_bar_is_open(monkeypatch, capsys):
    def fail(args):
        for _ in progress_bar(iterable=range(3), unit="step"):
            raise InputError("a.png: is broken")

    monkeypatch.setattr(doctor, "run", fail)
    monkeypatch.setattr("midastouch_tools.progress.SOON_S", 0.0)
    assert cli.main(["doctor"]) == 2
    *bar, error, rest = capsys.readouterr().err.split("\n")
    assert any("step" in line for line in bar)
    assert (error, rest) == ("midastouch: error: a.png: is broken", "")


def test_without_the_benchmark_its_commands_name_its_package(monkeypatch, capsys):
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda group: [])
    of_the_benchmark = COMMANDS.keys() - cli.command_parsers().keys()
    assert {"evaluate", "benchmark"} <= of_the_benchmark
    for name in of_the_benchmark:
        assert cli.main([name, "--help"]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert line.startswith(f"midastouch: error: {name}: ")
        assert "colcon build --packages-up-to midastouch_benchmark" in line


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


def test_a_training_that_cannot_be_or_would_overwrite_another_is_refused_at_once(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(pytest.importorskip("torch").cuda, "is_available", lambda: False)
    (tmp_path / "checkpoint.safetensors").write_bytes(b"a night's work")
    for words, reason in ((["--device", "cuda"], "finds no GPU"), (["--out", str(tmp_path)], f"--resume {tmp_path}")):
        assert cli.main(["train-tcn", *words]) == cli.EXIT_BAD_INPUT
        assert reason in capsys.readouterr().err


def test_earlier_work_under_the_name_of_an_output_is_kept(
    monkeypatch, tmp_path, no_symmetry_search, simulated_sequence, capsys
):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["build-codebook", "ball", "--size", "20", "--out", "book.npz"]) == 0
    for name in ("layout.json", "slide/notes.txt", "run.mcap"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("mine")
    before = {path: path.read_bytes() for path in tmp_path.rglob("*.*")}
    for words in (
        ["build-codebook", "eyebolt", "--size", "20", "--out", "book.npz"],
        ["foxglove", "--out", "layout.json"],
        ["simulate", "ball", "--out", "slide"],
        ["to-bag", str(simulated_sequence(n=1).path), "--out", "run.mcap"],
    ):
        assert cli.main(words) == cli.EXIT_BAD_INPUT
        assert f"{words[-1]}: exists" in capsys.readouterr().err
    assert {path: path.read_bytes() for path in before} == before
