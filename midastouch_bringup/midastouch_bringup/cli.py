"""The `midastouch` command: the demo, recordings, calibration, training, and what other packages add."""

from __future__ import annotations

import argparse
import importlib.metadata
import os
import shlex
import sys
from collections.abc import Mapping
from types import ModuleType

from midastouch_common.errors import InputError

from .commands import (
    build_codebook,
    calibrate,
    capture_background,
    demo,
    doctor,
    download,
    export,
    foxglove,
    import_weights,
    inspect,
    replay,
    run,
    simulate,
    store_mount,
    time_offset,
    to_bag,
    train_tcn,
    train_tdn,
    view,
)

_COMMANDS = (
    demo,
    download,
    simulate,
    build_codebook,
    capture_background,
    calibrate,
    to_bag,
    replay,
    time_offset,
    store_mount,
    run,
    view,
    inspect,
    export,
    foxglove,
    train_tdn,
    train_tcn,
    import_weights,
    doctor,
)

EXIT_BAD_INPUT = 2
EXIT_INTERRUPTED = 130


PLUGINS = "midastouch.commands"
"""Group of the entry points by which other packages bring commands, each a module as those of `commands`."""
OF_BENCHMARK = (
    *("bench", "bench-scale", "benchmark", "evaluate", "evaluate-checks", "evaluate-exploration", "evaluate-presses"),
    *("evaluate-start", "evaluate-tdn", "identify", "report", "single-touch"),
)
"""Commands of midastouch_benchmark; that package alone is not needed to use a sensor."""


class BrokenCommand:
    """Stands for a command of another package that cannot be imported: all others work, `doctor` among them."""

    def __init__(self, name: str, error: Exception):
        self.name, self.problem = name, f"{type(error).__name__}: {_one_line(error)}"

    def add_parser(self, subparsers) -> None:
        """Add the sub-command, which takes whatever is given and says what is wrong."""
        # no argument is an option to it, not even --help
        parser = subparsers.add_parser(self.name, help="cannot be loaded", add_help=False, prefix_chars="\0")
        parser.add_argument("anything", nargs="*")
        parser.set_defaults(run=self._refuse)

    def _refuse(self, _args: argparse.Namespace) -> int:
        raise InputError(f"{self.name}: cannot be loaded, {self.problem}; see midastouch doctor")


def commands_of_others() -> list[ModuleType | BrokenCommand]:
    """What other packages bring, by name: those of midastouch_benchmark, where that is installed."""
    found = importlib.metadata.entry_points(group=PLUGINS)
    return [_loaded(one) for one in sorted(found, key=lambda one: one.name)]


def _loaded(found: importlib.metadata.EntryPoint) -> ModuleType | BrokenCommand:
    try:
        command = found.load()
        _ = command.add_parser  # what is no command fails here, too
        return command
    except Exception as error:  # a broken install can fail in any way while it is imported
        return BrokenCommand(found.name.replace("_", "-"), error)


def build_parser() -> argparse.ArgumentParser:
    """The parser with every sub-command; each sets `run`, the function that carries it out."""
    parser = argparse.ArgumentParser(
        prog="midastouch",
        description="Where on the object is the touch sensor? Demo, recordings, calibration, simulation and training.",
        epilog="example:\n  midastouch demo\n\n`midastouch COMMAND --help` shows an example.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_commands(parser)
    return parser


def add_commands(parser: argparse.ArgumentParser) -> Mapping[str, argparse.ArgumentParser]:
    """Add every sub-command; returns their parsers by name."""
    subparsers = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    for command in (*_COMMANDS, *commands_of_others()):
        command.add_parser(subparsers)
    return subparsers.choices


def main(arguments: list[str] | None = None) -> int:
    """Run one command; returns the exit status: 0 success, 1 the command found a failure, 2 bad input."""
    arguments = sys.argv[1:] if arguments is None else arguments
    if arguments and arguments[0] in OF_BENCHMARK and not commands_of_others():
        print(
            f"midastouch: error: {arguments[0]}: comes with the package midastouch_benchmark, which is not installed; "
            "install it: run make, or colcon build --packages-up-to midastouch_benchmark",
            file=sys.stderr,
        )
        return EXIT_BAD_INPUT
    args = build_parser().parse_args(arguments)
    args.command_line = shlex.join(["midastouch", *_what(arguments)])  # for result files
    try:
        return args.run(args)
    except (InputError, OSError) as error:
        print(f"midastouch: error: {_one_line(error)}", file=sys.stderr)
        return EXIT_BAD_INPUT
    except KeyboardInterrupt:
        print("midastouch: interrupted", file=sys.stderr)
        return EXIT_INTERRUPTED


_WHERE = ("--json", "--out", "--cluster")


def _what(arguments: list[str]) -> list[str]:
    """Arguments without those that say where on this machine something is kept or run."""
    out, rest = [], iter(arguments)
    for argument in rest:
        if argument in _WHERE:
            next(rest, None)
        elif not argument.startswith(tuple(f"{option}=" for option in _WHERE)):
            out.append(argument)
    return out


def _one_line(error: Exception) -> str:
    if isinstance(error, FileExistsError):  # a folder was to be made there
        return f"{error.filename}: exists and is no folder; choose another place"
    if isinstance(error, OSError) and error.filename is not None and error.errno is not None:
        return f"{error.filename}: {os.strerror(error.errno)}"
    return " ".join(str(error).split()) or type(error).__name__


if __name__ == "__main__":
    sys.exit(main())
