"""`midastouch foxglove`: the layout for Foxglove."""

from __future__ import annotations

import argparse

from . import arguments


def add_parser(subparsers) -> None:
    """Add the sub-command."""
    parser = arguments.add_command(
        subparsers,
        "foxglove",
        run,
        "write the Foxglove layout for the nodes of a namespace",
        "midastouch foxglove --namespace left --out left.json",
        "For foxglove_bridge: import the file as a layout.",
    )
    parser.add_argument("--namespace", default="", metavar="NAME", help="of the nodes (default: none)")
    parser.add_argument("--out", metavar="FILE", required=True, help="the layout (JSON)")


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    import json
    from pathlib import Path

    from ..ros.launch_arguments import SHARE
    from ..view.foxglove_layout import in_namespace

    layout = json.loads((SHARE / "foxglove" / "midastouch.json").read_text())
    Path(args.out).write_text(json.dumps(in_namespace(layout, args.namespace), indent=2) + "\n")
    return 0
