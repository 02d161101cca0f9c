"""`midastouch demo`: simulated slide, real nodes over DDS, bag, table, pictures."""

from __future__ import annotations

import argparse

from ..demo import SEED
from . import arguments, limits


def add_parser(subparsers) -> None:
    """Add the sub-command."""
    parser = arguments.add_command(
        subparsers,
        "demo",
        run,
        "localise a simulated sensor on a bundled object with the real nodes, and draw what happened",
        "midastouch demo --object handle_tool --out out/demo",
        "Needs nothing but the installation. The nodes run as processes of their own and talk over DDS; the\n"
        "run is recorded, and its page with pictures opens in the browser where there is a display.",
    )
    parser.add_argument("--object", default="handle_tool", help="bundled object (default handle_tool)")
    parser.add_argument("--headless", action="store_true", help="do not open the page in a browser")
    arguments.add_place(parser, "--out", "folder", "folder for the results", "out/demo")
    parser.add_argument("--seed", type=limits.seed, default=SEED, help=f"of the slide (default {SEED})")
    parser.add_argument("--domain", type=limits.domain, metavar="ID", help="ROS_DOMAIN_ID (default: a free one)")


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    import os
    import sys
    import webbrowser
    from pathlib import Path

    from midastouch_common.errors import InputError
    from midastouch_perception.objects import bundled_objects

    from ..processes.local_domain import claimed_domain

    objects = bundled_objects()
    if args.object not in objects:
        raise InputError(f"--object {args.object}: not bundled; there are {', '.join(sorted(objects))}")
    from ..processes.supervisor import NodeFailed
    from ..ros.demo import run_demo

    # a domain of its own: neither another demo nor a robot on the network may hear the nodes
    domain = args.domain if args.domain is not None else claimed_domain()
    try:
        page = run_demo(Path(objects[args.object]), args.out, domain, args.seed)
    except NodeFailed as error:
        print(f"midastouch: error: {error}", file=sys.stderr)
        return 1
    print(f"pictures and table: {page}\nrecording: {args.out / 'run.mcap'}")
    if not args.headless and (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        webbrowser.open(page.resolve().as_uri())
    return 0
