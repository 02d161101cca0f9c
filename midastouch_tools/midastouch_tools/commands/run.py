"""`midastouch run`: the nodes of a launch file, without `ros2 launch`."""

from __future__ import annotations

import argparse

from . import arguments


def add_parser(subparsers) -> None:
    """Add the sub-command."""
    parser = arguments.add_command(
        subparsers,
        "run",
        run,
        "carry out a launch file, without ros2 launch",
        "midastouch run replay bag:=out/slide object:=handle_tool rate:=0",
        "SETUP is the name of a launch file (live_ur, replay, demo, driver, ...), or the path of yours, ending in\n"
        ".launch.py; the arguments are those of ros2 launch: --show-args lists them. RViz starts only with\n"
        "use_rviz:=true; midastouch view shows the same in a browser. Ctrl-C ends all nodes, and so does one that\n"
        "dies; with use_respawn:=true it is started again after 2 s, after twice as long each time that it dies again.",
    )
    parser.add_argument("setup", nargs="?", metavar="SETUP", help="what to start; without, the names are listed")
    parser.add_argument("arguments", nargs="*", default=[], metavar="NAME:=VALUE", help="arguments, as of ros2 launch")
    parser.add_argument(
        "--prepare", action="store_true", help="make what SETUP (demo, explore) lacks in this folder, and end"
    )
    parser.add_argument("-s", "--show-args", action="store_true", help="list the arguments of SETUP and end")


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    from ..ros.launch_file import manual, names, values
    from ..ros.run import prepare, run_setup

    if args.setup is None:
        print("\n".join(names()))
        return 0
    if args.show_args:
        print(manual(args.setup))
        return 0
    if args.prepare:
        prepare(args.setup, values(args.setup, args.arguments))
        return 0
    return run_setup(args.setup, args.arguments)
