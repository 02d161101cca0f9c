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
    arguments.add_name(parser, "--namespace", "namespace", "of the nodes")
    arguments.add_place(parser, "--out", "file", "the layout (JSON)", required=True)


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    import json

    from midastouch_common.files import atomic_path, require_new

    from ..ros.launch_file import SHARE

    require_new(args.out, "file")
    layout = json.loads((SHARE / "foxglove" / "midastouch.json").read_text())
    with atomic_path(args.out) as path:
        path.write_text(json.dumps(in_namespace(layout, args.namespace), indent=2) + "\n")
    print(f"{args.out}: open it in Foxglove, menu Layouts, Import from file")
    return 0


def in_namespace(layout: object, namespace: str) -> object:
    """Return a layout, or a part of one, with its topics moved into `namespace`.

    Every text and key that begins with a slash counts as a topic or a field of one.
    """
    if isinstance(layout, dict):
        return {in_namespace(key, namespace): in_namespace(value, namespace) for key, value in layout.items()}
    if isinstance(layout, list):
        return [in_namespace(value, namespace) for value in layout]
    if isinstance(layout, str) and layout.startswith("/") and (inside := namespace.strip("/")):
        return f"/{inside}{layout}"
    return layout
