"""`midastouch train-tdn`: train the `fast` depth network on simulated touches."""

from __future__ import annotations

import argparse
import dataclasses

from .training import add_training_command, training_options


def add_parser(subparsers) -> None:
    """Add the sub-command."""
    parser = add_training_command(subparsers, "train-tdn", run, "train the depth network on simulated touches")
    parser.add_argument(
        "--light",
        choices=("additive", "relative"),
        default="additive",
        help="of the sensors to train for: additive, TACTO's (default), or relative, real gel's",
    )


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    options = dataclasses.replace(training_options(args), light=args.light)
    from midastouch_simulation.training.tdn import train

    print(f"{train(options)}: trained")
    return 0
