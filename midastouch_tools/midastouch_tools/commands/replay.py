"""`midastouch replay`: play a bag, a sequence or plain images on the topics of a live sensor and arm."""

from __future__ import annotations

import argparse

from . import arguments, limits


def add_parser(subparsers) -> None:
    """Add the sub-command."""
    parser = arguments.add_command(
        subparsers,
        "replay",
        run,
        "play a sequence or a bag on the topics of a live sensor and arm",
        "midastouch replay out/demo/run.mcap --rate 2",
        "Publishes image_raw, camera_info, /tf, the ground truth on frames of its own, and /clock;\n"
        "of a folder of images or a video, which hold no poses: image_raw, camera_info and /clock.\n"
        "Keys: space pauses, right: next frame, left: 5 s back, up and down: faster and slower.\n"
        "From elsewhere: services replay/pause, resume and step; parameters rate, loop and seek_to of /replay.",
    )
    parser.add_argument(
        "source", metavar="BAG|SEQ", help="bag (.mcap file or folder), YCB-Slide sequence, folder of images or video"
    )
    parser.add_argument(
        "--rate", type=limits.replay_rate, default=1.0, help="recorded seconds per second; 0: at once (default 1)"
    )
    parser.add_argument("--loop", action="store_true", help="start again at the end")
    parser.add_argument("--paused", action="store_true", help="wait for the service replay/resume or replay/step")
    parser.add_argument(
        "--remap", nargs="+", default=[], metavar="FROM:=TO", help="topics of a bag that are played on others"
    )
    arguments.add_rotation(parser)
    parser.add_argument("--no-clock", action="store_true", help="do not publish /clock")


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    from ..replay.source import ReplaySource, parsed_remaps

    # refuses an unplayable source before anything is started
    ReplaySource(args.source, remaps=parsed_remaps(args.remap), rotation=args.rotation)
    from ..nodes.replay import main

    parameters = {
        "source": args.source,
        "remap": " ".join(args.remap),
        "rotation": args.rotation,
        "rate": float(args.rate),
        "loop": args.loop,
        "start_paused": args.paused,
        "clock": not args.no_clock,
    }
    return main(arguments.ros_arguments("replay", parameters))
