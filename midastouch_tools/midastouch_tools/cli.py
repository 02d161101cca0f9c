"""The `midastouch` command: the demo, recordings, calibration, training, and commands of other packages."""

from __future__ import annotations

import argparse
import os
import shlex
import shutil
import signal
import sys
import textwrap
from itertools import pairwise

from midastouch_common.errors import EXIT_BAD_INPUT, InputError
from midastouch_common.missing_modules import how_to_install

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
    inspect_bag,
    replay,
    run,
    simulate,
    time_offset,
    to_bag,
    training,
    view,
)
from .commands.plugins import commands_of_others, one_line
from .machine import package_version
from .processes.foreground import exit_status, interrupted_by_signals

_WHERE = {"--json", "--out", "--cluster"}  # options that only name a place on this machine, or a cluster
_SECTIONS = {
    "use": (demo, run, replay, view, doctor),
    "object": (download, build_codebook),
    "sensor and arm": (capture_background, calibrate, time_offset),
    "recordings": (inspect_bag, export, to_bag, simulate, foxglove),
    "networks": (training, import_weights),
}
_OF_OTHERS = "measure, and what other packages bring"
_INDENT = 24  # columns before the summary of a command


class Section:
    """Stand-in for argparse's sub-parsers, which know no headings, as the argument of a command's `add_parser`.

    Attributes: title; parsers, by name of the command.
    """

    def __init__(self, title: str, subparsers):
        self.title, self._subparsers = title, subparsers
        self.parsers: dict[str, argparse.ArgumentParser] = {}
        self._summaries: dict[str, str] = {}

    def add_parser(self, name: str, help: str = "-", **options):  # noqa: A002  the name that argparse gives it
        """Add a parser as argparse does; help: the summary, which only this section lists."""
        self._summaries[name] = help
        self.parsers[name] = self._subparsers.add_parser(name, **options)
        return self.parsers[name]

    def listed(self) -> str:
        """Return the title and the commands with their summaries, wrapped to the width of the terminal."""
        width = shutil.get_terminal_size().columns - 2
        lines = [
            textwrap.fill(
                summary,
                max(width, 2 * _INDENT),
                initial_indent=f"  {name}".ljust(_INDENT - 1) + " ",
                subsequent_indent=" " * _INDENT,
            )
            for name, summary in self._summaries.items()
        ]
        return "\n".join([f"{self.title}:", *lines])


def build_parser() -> argparse.ArgumentParser:
    """The parser with every sub-command; each sets `run`, the function that carries it out."""
    parser = argparse.ArgumentParser(
        prog="midastouch",
        usage="%(prog)s [-h] [--version] COMMAND ...",
        epilog="example:\n  midastouch demo\n\n`midastouch COMMAND --help` shows an example.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    # from the workspace, from the wheel; sources that are not installed have none
    version = package_version("midastouch_tools") or package_version("midastouch") or "unknown"
    parser.add_argument("--version", action="version", version=f"%(prog)s {version}")
    sections = add_commands(parser)
    what = "Where on the object is the touch sensor? Demo, recordings, calibration, simulation and training."
    parser.description = "\n\n".join([what, *(section.listed() for section in sections)])
    return parser


def add_commands(parser: argparse.ArgumentParser) -> list[Section]:
    """Add every sub-command; returns the sections that list them."""
    subparsers = parser.add_subparsers(prog="midastouch", metavar="COMMAND", required=True, help=argparse.SUPPRESS)
    sections = []
    for title, commands in {**_SECTIONS, _OF_OTHERS: commands_of_others()}.items():
        sections.append(section := Section(title, subparsers))
        for command in commands:
            command.add_parser(section)
    return [section for section in sections if section.parsers]


def command_parsers() -> dict[str, argparse.ArgumentParser]:
    """Return the parser of every sub-command, by name."""
    sections = add_commands(argparse.ArgumentParser())
    return {name: parser for section in sections for name, parser in section.parsers.items()}


def main(arguments: list[str] | None = None) -> int:
    """Run one command; return the exit status: 0 success, 1 the command found a failure, 2 bad input, 128 and the
    number of a signal that ended it: 130 Ctrl-C, 143 SIGTERM."""
    arguments = sys.argv[1:] if arguments is None else arguments
    if not arguments:
        build_parser().print_help(sys.stderr)
        return EXIT_BAD_INPUT
    if not (commands_of_others() or arguments[0].startswith("-") or arguments[0] in (parsers := command_parsers())):
        print(
            f"midastouch: error: {arguments[0]}: no such command; there are {', '.join(parsers)}. Those that measure "
            "come with the package midastouch_benchmark, which is not installed: in a clone run make, or colcon build "
            "--packages-up-to midastouch_benchmark",
            file=sys.stderr,
        )
        return EXIT_BAD_INPUT
    args = build_parser().parse_args(arguments)
    what = [each for before, each in pairwise(["", *arguments]) if not {before, each.partition("=")[0]} & _WHERE]
    args.command_line = shlex.join(["midastouch", *what])  # for result files
    try:
        with interrupted_by_signals():
            status = args.run(args)
            sys.stdout.flush()
            return status
    except BrokenPipeError:  # nobody reads on, as after `| head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 128 + signal.SIGPIPE
    except (InputError, OSError) as error:
        _say(f"error: {one_line(error)}")
        return EXIT_BAD_INPUT
    except ImportError as error:
        _say(f"error: {arguments[0]}: {how_to_install(error)}")
        return EXIT_BAD_INPUT
    except KeyboardInterrupt as interrupt:
        _say("interrupted")
        return exit_status(interrupt)


def _say(text: str) -> None:
    from .progress import close_bars  # here: most calls end without an error, and need no bars

    close_bars()
    print(f"midastouch: {text}", file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
