"""`midastouch evaluate-motion`: how well an arm in MuJoCo keeps commanded depths, and stops after faults."""

from __future__ import annotations

import argparse

from midastouch_tools.commands import arguments

from . import options


def add_parser(subparsers) -> None:
    """Add the sub-command."""
    parser = arguments.add_command(
        subparsers,
        "evaluate-motion",
        run,
        "measure how an arm in MuJoCo touches and slides by what the depth network reads, and how it stops",
        "midastouch evaluate-motion --meshes ../shared/meshes/ycb --trials 20 --json out/motion.json",
        "A UR in MuJoCo approaches an object somewhere, slides on, and on another slide something goes wrong. Camera,\n"
        "light, delays, friction, the error of the mount and how firmly the object is held are drawn at random.\n"
        "Finished trials are kept in --out: the same command goes on where it was stopped. Needs the mujoco extra.",
    )
    options.add_meshes_options(parser)
    parser.add_argument("--out", metavar="DIR", default="out/benchmark", help="default out/benchmark")
    parser.add_argument("--trials", type=arguments.positive_int, default=20, help="on each object (default 20)")
    options.add_sensor_option(parser, options.SIMULATED)
    options.add_workforce_options(parser, "trial")
    options.add_json_option(parser)


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    from pathlib import Path

    from midastouch_simulation.mujoco_arm import require_mujoco

    from ..trials.motion import MotionPlan

    require_mujoco()
    plan = MotionPlan(args.trials, args.sensor, Path(args.out))
    trials, result = options.run_campaign(args, plan, "trial")
    return options.conclude(args, "evaluate-motion", result | {"trials": trials})
