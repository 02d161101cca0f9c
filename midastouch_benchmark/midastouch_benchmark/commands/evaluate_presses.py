"""`midastouch evaluate-presses`: the depth network on real images of a pressed ball."""

from __future__ import annotations

import argparse

from midastouch_tools.commands import arguments

from . import options


def add_parser(subparsers) -> None:
    """Add the sub-command."""
    parser = arguments.add_command(
        subparsers,
        "evaluate-presses",
        run,
        "check the depth network on real presses of a ball of known size",
        "midastouch evaluate-presses ../shared/data/digit_real/sphere_presses_d20641 --ball-diameter 0.0088 "
        "--px-per-mm 18.68 --json out/presses.json",
        "DIR holds images of presses and, if there are, the no-contact image background.png (else it is made from the\n"
        "presses) and labelled contact circles, circles.csv with the columns frame,center_x_px,center_y_px,radius_px.\n"
        "The outline of a contact tells how deep a ball of that size was pressed; the measured map is compared with\n"
        "that ball. Without labels the images tell the outline: where one light for five or more presses explains\n"
        "them best. Where that fails, depth is not judged. Images that show no press are named and left out.",
    )
    parser.add_argument("folder", metavar="DIR", help="images of presses")
    parser.add_argument(
        "--ball-diameter", type=arguments.positive, required=True, metavar="METRES", help="diameter of the ball"
    )
    options.add_sensor_option(parser, "digit_real")
    parser.add_argument(
        "--px-per-mm", type=arguments.positive, metavar="X", help="scale of this very sensor (default: the model's)"
    )
    options.add_tdn_option(parser)
    calibrated = parser.add_mutually_exclusive_group()
    calibrated.add_argument("--calibration", metavar="FILE", help="the sensor's, by midastouch calibrate")
    calibrated.add_argument(
        "--calibrate-with",
        type=arguments.positive_int,
        metavar="N",
        help="judge each press with a calibration from N of the others, drawn with --seed",
    )
    parser.add_argument(
        "--check-labels",
        action="store_true",
        help="judge the labels too: by the ball where one light for all presses puts it; and the network by that ball",
    )
    parser.add_argument("--seed", type=arguments.seed, default=0, help="default 0")
    options.add_json_option(parser)


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    from pathlib import Path

    from midastouch_perception.sensor_calibration.calibration import SensorCalibration
    from midastouch_perception.sensor_model import SensorModel
    from midastouch_perception.tdn import load_tdn
    from midastouch_tools.datasets.ball_presses import load_ball_presses
    from midastouch_tools.machine import machine_info
    from midastouch_tools.progress import progress_bar
    from midastouch_tools.result_file import to_json

    from ..perception.depth_quality import brightness_effect
    from ..perception.press_quality import measure_presses
    from ..perception.press_truth import calibrations_of, usable_presses, with_truth
    from ..tables.perception import presses_table
    from ..tables.table import terminal

    sensor = SensorModel.load(args.sensor)
    if args.px_per_mm:
        sensor = sensor.at_scale(1e3 * args.px_per_mm)
    presses, unusable = usable_presses(load_ball_presses(args.folder), sensor)
    tdn = load_tdn(args.tdn, sensor)
    settings = {
        "ball_diameter": args.ball_diameter,
        "calibration": args.calibration,
        "calibrated_with": args.calibrate_with,
        "seed": args.seed,
    }
    calibrations = calibrations_of(settings, presses, sensor)
    known = with_truth(presses, args.ball_diameter, sensor)
    with progress_bar(total=len(presses.images), unit="press") as bar:
        rows, summary = measure_presses(tdn, known.presses, args.ball_diameter / 2, bar.update, calibrations)
    summary["brightness_mm"] = 1e3 * brightness_effect(tdn, presses, calibrations)
    checked = _check_labels(args, presses, sensor, tdn, calibrations) if args.check_labels else {}
    result = to_json(
        {
            "folder": str(Path(args.folder).resolve()),
            **settings,
            "px_per_mm": args.px_per_mm,
            "tdn": args.tdn,
            "network": tdn.network_id,
            "sensor": args.sensor,
            "model_calibration": SensorCalibration.default(sensor) is not None,
            "machine": machine_info(),
            "unusable": _listed(unusable),
            "unfitted": _listed(known.unfitted),
            "depth_problem": known.problem,
            "presses": rows,
            "summary": summary,
            **checked,
        }
    )
    return options.conclude(args, result, *_notes(result), terminal(presses_table([result])), parts=("real_gel",))


def _listed(problems: dict[str, str]) -> list[dict[str, str]]:
    return [{"image": name, "problem": problem} for name, problem in problems.items()]


def _notes(result: dict) -> list[str]:
    """Return a line for each image that was left out, with the reason."""
    notes = [f"{each['image']}: not used: {each['problem']}" for each in result["unusable"]]
    notes += [f"{each['image']}: depth not judged: {each['problem']}" for each in result["unfitted"]]
    if problem := result["depth_problem"]:
        notes.append(f"depth cannot be judged: no circles.csv, and the images do not tell where the ball is: {problem}")
    return notes


def _check_labels(args: argparse.Namespace, presses, sensor, tdn, calibrations) -> dict[str, dict]:
    from midastouch_common.errors import InputError

    from ..perception.press_quality import measure_presses
    from ..perception.press_truth import FittedBall

    if presses.circles is None:
        raise InputError(f"{args.folder}: no circles.csv, so there are no labels to check; leave out --check-labels")
    ball, radius = FittedBall(presses, args.ball_diameter, sensor), args.ball_diameter / 2
    return {
        "labels": measure_presses(ball, presses.only(list(ball.presses.images)), radius)[1],  # type: ignore[arg-type] # it replaces one
        "against_fit": measure_presses(tdn, ball.presses, radius, calibrations=calibrations)[1],
    }
