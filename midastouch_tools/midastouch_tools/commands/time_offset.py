"""`midastouch time-offset`: the offset between the stamps of the camera and of the arm."""

from __future__ import annotations

import argparse

from . import arguments


def add_parser(subparsers) -> None:
    """Add the sub-command."""
    parser = arguments.add_command(
        subparsers,
        "time-offset",
        run,
        "measure by a recorded slide how far the stamps of the images are from those of the arm",
        "midastouch time-offset out/touch.mcap",
        "Slide over edges of an object for 10 s or longer, start and stop several times, and record it. The\n"
        "moment at which images change is compared with that at which the arm moves.",
    )
    parser.add_argument("bag", metavar="BAG", help="bag with images and transforms (.mcap file or folder)")
    arguments.add_bag_options(parser)


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    from ..bags.images import read_bag
    from ..bags.time_offset import estimate_time_offset

    frames = read_bag(args.bag, arguments.gel_stream(args))
    offset = estimate_time_offset(frames, args.bag)
    late = "late" if offset.seconds >= 0 else "early"
    print(f"images are stamped {1e3 * abs(offset.seconds):.0f} ms too {late} (correlation {offset.correlation:.2f})")
    print(f"add {round(-1e9 * offset.seconds)} to the parameter timestamp_offset of digit_driver")
    return 0
