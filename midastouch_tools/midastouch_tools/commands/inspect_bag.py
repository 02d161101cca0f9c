"""`midastouch inspect-bag`: what a bag holds, what of it can be used, what is missing, and the command to continue."""

from __future__ import annotations

import argparse
from pathlib import Path

from . import arguments


def add_parser(subparsers) -> None:
    """Add the sub-command."""
    parser = arguments.add_command(
        subparsers,
        "inspect-bag",
        run,
        "show what a bag holds, what of it can be used, what is missing, and the command that plays it",
        "midastouch inspect-bag out/demo/run.mcap",
        "Looks at the first messages only. Exits with 1 if the bag gives no pose.",
    )
    parser.add_argument("bag", metavar="BAG", help=".mcap file, or folder with metadata.yaml")
    arguments.add_frame_options(parser)


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    from ..replay.inspection import inspect_bag
    from ..text_table import text_table

    found = inspect_bag(Path(args.bag), args.base_frame, args.gel_frame)
    print(f"{args.bag}: {found.duration_s:.1f} s")
    print(text_table(["topic", "type", "messages", "1/s", "first image"], found.rows, left=2))
    parts = {"usable": found.usable, "missing": found.missing, "continue with": found.commands, "note": found.notes}
    for title, lines in parts.items():
        if lines:
            print(f"\n{title}:")
            print("\n".join(f"  {line}" for line in lines))
    return int(bool(found.missing))
