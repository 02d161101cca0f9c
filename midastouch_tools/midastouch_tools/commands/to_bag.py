"""`midastouch to-bag`: a sequence as a rosbag2 file."""

from __future__ import annotations

import argparse

from . import arguments


def add_parser(subparsers) -> None:
    """Add the sub-command."""
    parser = arguments.add_command(
        subparsers,
        "to-bag",
        run,
        "convert a YCB-Slide sequence to a rosbag2 file",
        "midastouch to-bag ../shared/data/ycb_slide_sim/035_power_drill/00 --out out/drill.mcap",
        "With image, camera info, transforms, and the ground truth on its own frame; `ros2 bag` reads it.",
    )
    parser.add_argument("sequence", metavar="SEQ", help="YCB-Slide sequence folder")
    what = "file ending in .mcap, or a bag folder"
    arguments.add_place(parser, "--out", "file or folder", what, required=True, metavar="BAG")


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    from ..bags.writer import write_bag
    from ..datasets import load_sequence
    from ..datasets.writer import write_image
    from ..text_table import counted

    sequence = load_sequence(args.sequence)
    write_bag(sequence, args.out)
    if sequence.background is not None:
        file = args.out.with_suffix(".background.png") if args.out.is_file() else args.out / "background.png"
        write_image(file, sequence.background)
        print(f"{file}: the no-contact image, which a replay of the bag takes from there")
    dropped = f"; {sequence.dropped_frames} whose pose is missing or jumps left out" if sequence.dropped_frames else ""
    print(f"{args.out}: {counted(sequence.n_frames, 'frame')} of {sequence.object_name}{dropped}")
    return 0
