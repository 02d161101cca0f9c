"""`midastouch evaluate-checks`: how often the checks on tactile images are wrong."""

from __future__ import annotations

import argparse

from midastouch_tools.commands import arguments

from . import options

_RECORDS = 12  # of slow light on each calibrated sensor


def add_parser(subparsers) -> None:
    """Add the sub-command."""
    parser = arguments.add_command(
        subparsers,
        "evaluate-checks",
        run,
        "measure false and missed alarms of the fit check, the contact decision and the background capture",
        "midastouch evaluate-checks ../shared/data/digit_backgrounds --json out/checks.json",
        "On imaginary sensors as the depth network is trained on, over real no-contact images, and on those\n"
        "images themselves. Light touches are on an eyebolt and on a wire 2 mm thick. --presses adds real sensors.",
    )
    parser.add_argument("backgrounds", metavar="DIR", help="no-contact images of many DIGITs")
    parser.add_argument("--sensors", type=arguments.positive_int, default=40, help="imaginary sensors (default 40)")
    parser.add_argument(
        "--presses", nargs="+", default=(), metavar="DIR", help="presses of a ball on real DIGITs, as evaluate-presses"
    )
    parser.add_argument("--colour-table", metavar="NPZ", help="Taxim's table, if the network was trained with it")
    options.add_sensor_option(parser, options.SIMULATED)
    options.add_tdn_option(parser)
    parser.add_argument("--seed", type=arguments.seed, default=0, help="of sensors and touches (default 0)")
    options.add_json_option(parser)


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    from ..tables.checks import check_tables
    from ..tables.table import terminal

    result = _measured(args)
    return options.conclude(args, result, "\n\n".join(map(terminal, check_tables(result))), parts=("real_gel",))


def _measured(args: argparse.Namespace) -> dict:
    import itertools
    from pathlib import Path

    import numpy as np

    from midastouch_perception.sensor_model import SensorModel
    from midastouch_perception.tdn import load_tdn
    from midastouch_simulation.optics import ColourTable
    from midastouch_simulation.randomisation import RandomisationRange
    from midastouch_simulation.training.setting import load_backgrounds
    from midastouch_tools.datasets.ball_presses import load_ball_presses
    from midastouch_tools.machine import machine_info
    from midastouch_tools.progress import progress_bar
    from midastouch_tools.result_file import to_json

    from ..perception.check_quality import (
        TOUCHES,
        CheckQuality,
        causes_named,
        diameter_checks,
        imaginary_sensors,
        layout_quality,
        real_checks,
    )
    from ..perception.contact_quality import Reading, measured_readings, mini_reading, missed_touches, slow_light
    from ..perception.gel_quality import gels_known

    sensor = SensorModel.load(args.sensor)
    presses = {Path(folder).name: load_ball_presses(folder) for folder in args.presses}
    backgrounds = np.concatenate(load_backgrounds(args.backgrounds, sensor.height, sensor.width))
    ranges = RandomisationRange(colour_table=ColourTable.load(args.colour_table) if args.colour_table else None)
    tdn = load_tdn(args.tdn, sensor)
    quality = CheckQuality(tdn)
    rng = np.random.default_rng(args.seed)
    sensors = imaginary_sensors(args.sensors + 1, sensor, backgrounds, ranges, rng)
    for own, other in progress_bar(iterable=itertools.pairwise(sensors), total=args.sensors, unit="sensor"):
        quality.add(own, other)
    real = SensorModel.load("digit_real")
    tdn_of_real = load_tdn(args.tdn, real)
    large = np.concatenate(load_backgrounds(args.backgrounds, real.height, real.width))
    digits = [Reading("DIGIT", tdn_of_real, background) for background in large]
    measured = measured_readings(args.tdn, rng)
    calibrated = [each for each in measured if each.tdn.calibration_in_use] + [mini_reading(args.tdn)]
    return to_json(
        {
            "network": tdn.network_id,
            "sensor": args.sensor,
            "sensors": args.sensors,
            "no_contact_images": len(backgrounds),
            "seed": args.seed,
            "machine": machine_info(),
            "fit_check": quality.fit(),
            "no_contact_image": layout_quality(backgrounds),
            "cause_named": causes_named(backgrounds),
            "capture": quality.capture(),
            "contact": quality.contact(),
            "light_touches": missed_touches(measured, TOUCHES * args.sensors, rng),
            "real_sensors": {name: real_checks(tdn_of_real, each, rng) for name, each in presses.items()},
            "gels": gels_known(tdn_of_real, presses, large, real, rng),
            "slow_light": slow_light(digits, 1, rng) + slow_light(calibrated, _RECORDS, rng),
            "ball_diameter": diameter_checks(real, large, args.sensors, rng),
        }
    )
