"""The `midastouch` command: offline tools, the demo and training."""

from __future__ import annotations

import argparse
import os
import shlex
import sys
from collections.abc import Mapping

from midastouch_common.errors import InputError

from .commands import (
    bench,
    bench_scale,
    benchmark,
    build_codebook,
    calibrate,
    capture_background,
    demo,
    doctor,
    download,
    evaluate,
    evaluate_checks,
    evaluate_exploration,
    evaluate_presses,
    evaluate_start,
    evaluate_tdn,
    export,
    foxglove,
    identify,
    import_weights,
    inspect,
    replay,
    report,
    run,
    simulate,
    single_touch,
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
    evaluate,
    evaluate_tdn,
    evaluate_presses,
    evaluate_checks,
    evaluate_exploration,
    evaluate_start,
    capture_background,
    calibrate,
    single_touch,
    bench,
    bench_scale,
    benchmark,
    identify,
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
    report,
    doctor,
)

EXIT_BAD_INPUT = 2
EXIT_INTERRUPTED = 130


def build_parser() -> argparse.ArgumentParser:
    """The parser with every sub-command; each sets `run`, the function that carries it out."""
    parser = argparse.ArgumentParser(
        prog="midastouch",
        description="Where on the object is the touch sensor? Demo, evaluation, simulation and training.",
        epilog="example:\n  midastouch demo\n\n`midastouch COMMAND --help` shows an example.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_commands(parser)
    return parser


def add_commands(parser: argparse.ArgumentParser) -> Mapping[str, argparse.ArgumentParser]:
    """Add every sub-command; returns their parsers by name."""
    subparsers = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    for command in _COMMANDS:
        command.add_parser(subparsers)
    return subparsers.choices


def main(arguments: list[str] | None = None) -> int:
    """Run one command; returns the exit status: 0 success, 1 the command found a failure, 2 bad input."""
    arguments = sys.argv[1:] if arguments is None else arguments
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
