"""`midastouch capture-background`: the no-contact image of a sensor that runs."""

from __future__ import annotations

import argparse

from . import arguments


def add_parser(subparsers) -> None:
    """Add the sub-command."""
    parser = arguments.add_command(
        subparsers,
        "capture-background",
        run,
        "keep the next images of a running sensor, with nothing touching it, as its no-contact image",
        "midastouch capture-background",
        "Calls the service capture_background of the running node tdn. Started with the sensor's serial number, that\n"
        "node keeps the image for its next start.",
    )
    arguments.add_name(parser, "--namespace", "namespace", "of the node")


def run(args: argparse.Namespace) -> int:
    """Carry out the command; 1 if the images are refused."""
    from ..ros.local_context import trigger

    answer = trigger("capture_background", "midastouch run perception", args.namespace)
    print(answer.message)
    return 0 if answer.success else 1
