"""The `midastouch` command: the demo, recordings, calibration, training, and commands of other packages."""

from __future__ import annotations

import argparse
import shlex
import sys

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
    replay,
    run,
    simulate,
    time_offset,
    to_bag,
    train_tcn,
    train_tdn,
    view,
)
from .commands.plugins import commands_of_others, one_line
from .commands.sections import Section
from .machine import package_version

_SECTIONS = {
    "use": (demo, run, replay, view, doctor),
    "object": (download, build_codebook),
    "sensor and arm": (capture_background, calibrate, time_offset),
    "recordings": (export, to_bag, simulate, foxglove),
    "networks": (train_tdn, train_tcn, import_weights),
}
_OF_OTHERS = "measure, and what other packages bring"

EXIT_INTERRUPTED = 130
OF_BENCHMARK = (
    *(
        "bench",
        "bench-scale",
        "benchmark",
        "evaluate",
        "evaluate-checks",
        "evaluate-exploration",
        "evaluate-gel",
        "evaluate-motion",
    ),
    *("evaluate-perception", "evaluate-presses", "evaluate-start", "evaluate-tdn", "evidence", "fingerprint"),
    *("ideal-observer", "identify", "report", "single-touch"),
)
"""Commands of midastouch_benchmark; that package alone is not needed to use a sensor."""


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


def main(arguments: list[str] | None = None) -> int:
    """Run one command; return the exit status: 0 success, 1 the command found a failure, 2 bad input, 130 Ctrl-C."""
    arguments = sys.argv[1:] if arguments is None else arguments
    if arguments and arguments[0] in OF_BENCHMARK and not commands_of_others():
        print(
            f"midastouch: error: {arguments[0]}: comes with the package midastouch_benchmark, which is not installed; "
            "install it: run make, or colcon build --packages-up-to midastouch_benchmark",
            file=sys.stderr,
        )
        return EXIT_BAD_INPUT
    parser = build_parser()
    if not arguments:
        parser.print_help(sys.stderr)
        return EXIT_BAD_INPUT
    args = parser.parse_args(arguments)
    args.command_line = shlex.join(["midastouch", *_what(arguments)])  # for result files
    try:
        return args.run(args)
    except (InputError, OSError) as error:
        _say(f"error: {one_line(error)}")
        return EXIT_BAD_INPUT
    except ImportError as error:
        _say(f"error: {arguments[0]}: {how_to_install(error)}")
        return EXIT_BAD_INPUT
    except KeyboardInterrupt:
        _say("interrupted")
        return EXIT_INTERRUPTED


def _say(text: str) -> None:
    from .progress import close_bars  # here: most calls end without an error, and need no bars

    close_bars()
    print(f"midastouch: {text}", file=sys.stderr)


_WHERE = ("--json", "--out", "--cluster")


def _what(arguments: list[str]) -> list[str]:
    """Drop the options that only name a place on this machine or a cluster: they do not change the result."""
    out, rest = [], iter(arguments)
    for argument in rest:
        if argument in _WHERE:
            next(rest, None)
        elif not argument.startswith(tuple(f"{option}=" for option in _WHERE)):
            out.append(argument)
    return out


if __name__ == "__main__":
    sys.exit(main())
