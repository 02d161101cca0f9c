"""`midastouch fingerprint`: the ids of today's code, and the renewal of the committed fingerprint."""

from __future__ import annotations

import argparse

from midastouch_tools.commands import arguments


def add_parser(subparsers) -> None:
    """Add the sub-command."""
    parser = arguments.add_command(
        subparsers,
        "fingerprint",
        run,
        "tell the ids of what makes estimates, which every report stores",
        "midastouch fingerprint",
        "Small probes of simulator, networks, renderer, codebook and filter, and the values of constants. A renamed\n"
        "or commented line leaves the ids as they are; an estimate that changes, changes them.",
    )
    parser.add_argument(
        "--write", action="store_true", help="make reports/fingerprint.json today's, a few minutes; commit it"
    )


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    from ..evidence import fingerprint

    if args.write:
        for part, what in fingerprint.write().items():
            shown = ", ".join(what[:8]) + (f" and {len(what) - 8} more" if len(what) > 8 else "")
            print(f"{part}: {'changed: ' + shown if what else 'as it was'}")
        fingerprint.today.cache_clear()
    for part, name in fingerprint.today().items():
        print(f"{part}: {name}")
    return 0
