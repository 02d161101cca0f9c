"""`midastouch train-tdn`: train the `fast` depth network on simulated touches."""

from __future__ import annotations

import argparse

from .training import add_training_command, training_options


def add_parser(subparsers) -> None:
    """Add the sub-command."""
    add_training_command(subparsers, "train-tdn", run, "train the depth network on simulated touches")


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    options = training_options(args)
    from midastouch_perception.tdn.train import train

    print(f"{train(options)}: trained")
    return 0
