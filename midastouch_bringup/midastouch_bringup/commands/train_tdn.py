"""`midastouch train-tdn`: train the `fast` depth network on simulated touches."""

from __future__ import annotations

import argparse
from pathlib import Path

from .training import add_training_command, run_training


def add_parser(subparsers) -> None:
    """Add the sub-command."""
    parser = add_training_command(subparsers, "train-tdn", run, "train the depth network on simulated touches")
    parser.add_argument(
        "--backgrounds",
        default="../shared/data/digit_backgrounds",
        metavar="DIR",
        help="real no-contact images (default %(default)s)",
    )


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""

    def train(**options):
        from midastouch_perception.tdn.train import train

        return train(backgrounds=Path(args.backgrounds), **options)

    return run_training(args, train)
