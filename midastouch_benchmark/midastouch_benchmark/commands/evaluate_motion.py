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
    from midastouch_tools.machine import machine_info

    from ..tables.motion import fault_table, motion_table
    from ..tables.table import terminal
    from ..trials.motion import MotionPlan, run_motion
    from ..trials.object_sets import chosen_meshes
    from ..trials.trial_log import TrialLog

    require_mujoco()
    plan = MotionPlan(args.trials, args.sensor)
    meshes = chosen_meshes(args.meshes, args.objects, args.out)
    with options.campaign(args, "trial") as workforce:
        trials, missing = run_motion(plan, meshes, TrialLog(Path(args.out) / "motion.jsonl"), workforce)
    result = {"config": plan.describe(), "machine": machine_info(), "missing_trials": missing, "trials": trials}
    tables = terminal(motion_table(trials)), terminal(fault_table(trials))
    return options.conclude(args, result, "\n\n".join(tables), *options.left(missing, "trial"), parts=("perception",))
