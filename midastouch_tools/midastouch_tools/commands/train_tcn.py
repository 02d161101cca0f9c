"""`midastouch train-tcn`: train the `fast` code network on simulated touches."""

from __future__ import annotations

import argparse

from .training import add_training_command, training_options


def add_parser(subparsers) -> None:
    """Add the sub-command."""
    parser = add_training_command(subparsers, "train-tcn", run, "train the code network on simulated touches")
    parser.add_argument(
        "--tdn", default="fast", metavar="NET", help="depth network the touches go through (default fast)"
    )


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    options = training_options(args)
    from midastouch_simulation.training.tcn import train

    print(f"{train(options, args.tdn)}: trained")
    return 0
