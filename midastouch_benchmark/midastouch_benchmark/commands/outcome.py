"""How the commands that measure end: their result is kept where --json says, and shown."""

from __future__ import annotations

import argparse


def add_json_option(parser: argparse.ArgumentParser) -> None:
    """--json, which `conclude` takes."""
    parser.add_argument("--json", metavar="OUT", help="write the results here")


def conclude(args: argparse.Namespace, result: dict, *shown: str) -> int:
    """Keep `result` where --json says, with the command line that made it, and print what is shown; the exit status."""
    from midastouch_bringup.result_file import write_compact_json

    if args.json:
        write_compact_json(args.json, {"command": args.command_line} | result)
    print("\n".join(shown))
    return 0
