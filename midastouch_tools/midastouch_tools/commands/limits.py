"""Numbers on the command line: argparse types with an upper bound, beyond which a command would hardly end, and why."""

from __future__ import annotations

import argparse
from collections.abc import Callable


def whole(most: int, why: str, least: int = 1) -> Callable[[str], int]:
    """Return an argparse type: a whole number from `least` to `most`; why: reason of the upper bound."""

    def number(text: str) -> int:
        value = _read(text, int)
        if value is None or not least <= value <= most:
            raise argparse.ArgumentTypeError(f"{text!r} is not a whole number from {least} to {most:,} ({why})")
        return int(value)

    return number


def above_zero(most: float, why: str, or_zero: bool = False) -> Callable[[str], float]:
    """Return an argparse type: a number above 0, or at least 0, and up to `most`; why: reason of the upper bound."""

    def number(text: str) -> float:
        value = _read(text, float)
        if value is None or not (0 < value <= most or (or_zero and value == 0)):
            least = "from 0" if or_zero else "above 0"
            raise argparse.ArgumentTypeError(f"{text!r} is not a number {least} and up to {most:,g} ({why})")
        return value

    return number


def _read(text: str, kind: type) -> float | None:
    try:
        return kind(text)
    except ValueError:
        return None


count = whole(100_000, "more would take weeks")
queries = whole(1_000_000, "more would take days")
poses = whole(2_000_000, "a million poses of a codebook fill 1 GB")
steps = whole(100_000_000, "more would take months")
jobs = whole(1024, "no machine has more cores")
seed = whole(2**63 - 1, "the nodes take 64 bits", least=0)
port = whole(65_535, "the last port; those below 1024 need privileges", least=1024)
domain = whole(101, "the last ROS_DOMAIN_ID with ports on every system", least=0)
path_length = above_zero(100, "metres; a slide of 100 m has 67,000 images")
ball_diameter = above_zero(0.1, "metres; a ball of 6 mm is 0.006")
pixels_per_mm = above_zero(1000, "a pixel of 1 micrometre")
minutes = above_zero(100_000, "over two months")
drawings_per_s = above_zero(60, "few screens show more")
replay_rate = above_zero(1000, "0 plays at once", or_zero=True)
voxel_size = above_zero(2, "the contact is scaled to [-1, 1]")
