"""`midastouch evidence` and `fingerprint`: reports of other code than today's, made again, and the ids of today's."""

from __future__ import annotations

import argparse

from midastouch_common.errors import InputError
from midastouch_tools.commands import arguments, limits


def add_parser(subparsers) -> None:
    """Add the sub-commands."""
    _add_fingerprint(subparsers)
    parser = arguments.add_command(
        subparsers,
        "evidence",
        run,
        "make every report again that is of other code than today's, the most important first",
        "midastouch evidence --minutes 180",
        "The reports are those of reports/README.md, each made by the command that is named there, in a checkout with\n"
        "../shared beside it. The same command continues where it was stopped.",
    )
    parser.add_argument("reports", nargs="*", default=[], metavar="NAME", help="only these (default: all)")
    parser.add_argument("--list", action="store_true", help="show what would be made")
    parser.add_argument(
        "--check", action="store_true", help="make nothing; exit 1 while a headline figure is of other code"
    )
    parser.add_argument("--headline", action="store_true", help="only those whose figures stand on the pages of docs/")
    parser.add_argument("--minutes", type=limits.minutes, help="start nothing after this time")
    arguments.add_jobs_option(parser)


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    from ..evidence import fingerprint
    from ..evidence.driver import carry_out, plan
    from ..tables.reports import COMMANDS
    from ..tables.table import listed, terminal

    if unknown := [name for name in args.reports if name not in COMMANDS]:
        raise InputError(f"{', '.join(unknown)}: no such report; there are {', '.join(COMMANDS)}")
    steps = [each for each in plan(args.reports or None) if each.headline or not args.headline]
    open_ = [each for each in steps if each.state != "today"]
    if args.check:
        old = [each.name for each in open_ if each.headline]
        if not fingerprint.is_of_today():
            print(f"reports/fingerprint.json is of other code; run: {fingerprint.RENEW}")
            return 1
        print("\n".join(f"{name}: of other code" for name in old) or "every headline figure is of today's code")
        return 1 if old else 0
    if args.list:
        rows = [(each.name, "headline" if each.headline else "", each.state, each.command) for each in steps]
        print(terminal(listed(("report", "", "fingerprint", "command"), rows)))
        print(f"{len(open_)} to make, {sum(each.headline for each in open_)} of them headline")
        return 0
    if not fingerprint.is_of_today():
        raise InputError(f"reports/fingerprint.json is of other code; run: {fingerprint.RENEW}")
    failed = carry_out(open_, args.jobs, args.minutes)
    if failed:
        print(f"failed: {', '.join(failed)}")
    return 1 if failed else 0


def _add_fingerprint(subparsers) -> None:
    parser = arguments.add_command(
        subparsers,
        "fingerprint",
        _fingerprint,
        "tell the ids of what makes estimates, which every report stores",
        "midastouch fingerprint",
        "Small probes of simulator, networks, renderer, codebook and filter, and the values of constants. A renamed\n"
        "or commented line leaves the ids as they are; an estimate that changes, changes them.",
    )
    parser.add_argument(
        "--write", action="store_true", help="make reports/fingerprint.json today's, a few minutes; commit it"
    )


def _fingerprint(args: argparse.Namespace) -> int:
    from ..evidence import fingerprint

    if args.write:
        for part, what in fingerprint.write().items():
            shown = ", ".join(what[:8]) + (f" and {len(what) - 8} more" if len(what) > 8 else "")
            print(f"{part}: {'changed: ' + shown if what else 'as it was'}")
        fingerprint.today.cache_clear()
    for part, name in fingerprint.today().items():
        print(f"{part}: {name}")
    return 0
