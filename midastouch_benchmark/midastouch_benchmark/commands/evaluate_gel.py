"""`midastouch evaluate-gel`: effect of soft gel on maps, depth, poses and codes."""

from __future__ import annotations

import argparse

from midastouch_tools.commands import arguments

from . import options


def add_parser(subparsers) -> None:
    """Add the sub-command."""
    parser = arguments.add_command(
        subparsers,
        "evaluate-gel",
        run,
        "measure what soft gel does to penetration maps, depth, poses and codes",
        "midastouch evaluate-gel --touches 20 --json out/gel.json",
        "Touches at known poses and presses of known depth, seen by the sensors whose optics were measured,\n"
        "uncalibrated and calibrated, through gel that sinks in as an elastic layer does, 1.5, 3 and 6 mm thick, and\n"
        "as every other evaluation has it.",
    )
    options.add_meshes_options(parser)
    parser.add_argument("--touches", type=arguments.positive_int, default=20, help="on each object (default 20)")
    parser.add_argument(
        "--presses", type=arguments.positive_int, default=50, help="of balls and of flat faces (default 50)"
    )
    parser.add_argument("--seed", type=arguments.seed, default=0, help="of touches and presses (default 0)")
    options.add_json_option(parser)


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    from midastouch_tools.result_file import to_json

    from ..tables.soft_gel import commanded_depth, soft_gel
    from ..tables.table import terminal

    result = to_json(_measured(args))
    tables = terminal(soft_gel(result)), terminal(commanded_depth(result))
    return options.conclude(args, result, "\n\n".join(tables), parts=("real_gel",))


def _measured(args: argparse.Namespace) -> dict:
    import numpy as np

    from midastouch_perception.sensor_model import SensorModel
    from midastouch_perception.tcn import load_tcn
    from midastouch_simulation.measured_optics import MeasuredOptics, measured_sensors
    from midastouch_tools.machine import machine_info
    from midastouch_tools.progress import progress_bar

    from ..perception.soft_gel import THICKNESSES, CommandedPresses, SoftGelTouches, SoftSensor
    from ..trials.object_sets import chosen_meshes

    meshes = chosen_meshes(args.meshes, args.objects, "out/benchmark")
    sensor = SensorModel.load("digit_real")
    tcn, sensors = load_tcn("fast", sensor), []
    for number, name in enumerate(measured_sensors()):
        optics = MeasuredOptics.load(name)
        for thickness in THICKNESSES:
            sensors.append(SoftSensor(optics, sensor, thickness))
            sensors.append(SoftSensor(optics, sensor, thickness, np.random.default_rng([args.seed, number])))
    pressed = CommandedPresses(sensor, args.presses, np.random.default_rng(args.seed))
    presses = [row for each in sensors for row in pressed.seen_by(each)]
    touches = []
    for mesh in progress_bar(iterable=meshes, total=len(meshes), unit="object"):
        # the seed of an object does not depend on which others are measured
        rng = np.random.default_rng([args.seed, int(mesh.sha256[:8], 16)])
        touched = SoftGelTouches(mesh, sensor, tcn, args.touches, rng)
        touches += [row for each in sensors for row in touched.seen_by(each)]
    return {"seed": args.seed, "machine": machine_info(), "touches": touches, "presses": presses}
