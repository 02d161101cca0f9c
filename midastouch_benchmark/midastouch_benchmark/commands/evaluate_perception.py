"""`midastouch evaluate-perception`: how well the images of a sensor are read, in six reports."""

from __future__ import annotations

import argparse
from importlib import import_module

from midastouch_tools.commands import arguments, limits

from . import options


def add_parser(subparsers) -> None:
    """Add the sub-command with its reports, and the former command of each, which the next release drops."""
    parser = arguments.add_command(
        subparsers,
        "evaluate-perception",
        run,
        "measure how well images are read: depth network, presses of a ball, soft gel, ramps, checks, guards",
        "midastouch evaluate-perception checks ../shared/data/digit_backgrounds --json out/checks.json",
        "Each report has --help of its own.",
    )
    reports = parser.add_subparsers(metavar="REPORT", required=True, help="what is measured")
    for report, (module, add_options, *words) in _REPORTS.items():
        former = [(subparsers, f"evaluate-{report}")] if report in _FORMER else []
        for place, name in [(reports, report), *former]:
            added = arguments.add_command(place, name, run, *words)
            add_options(added)
            options.add_json_option(added)
            added.set_defaults(report=report, module=module)


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    measured = import_module(f"..perception.{args.module}", __package__).report(args)
    return options.conclude(args, f"evaluate-perception {args.report}", measured)


def _add_tdn_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("sequences", nargs="+", metavar="SEQ", help="YCB-Slide sequence folders (simulated)")
    options.add_tdn_option(parser)
    options.add_sensor_option(parser, "")
    options.add_sequence_options(parser)


def _add_presses_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("folder", metavar="DIR", help="images of presses")
    parser.add_argument(
        "--ball-diameter", type=limits.ball_diameter, required=True, metavar="METRES", help="diameter of the ball"
    )
    options.add_sensor_option(parser, "digit_real")
    parser.add_argument(
        "--px-per-mm", type=limits.pixels_per_mm, metavar="X", help="scale of this very sensor (default: the model's)"
    )
    options.add_tdn_option(parser)
    calibrated = parser.add_mutually_exclusive_group()
    calibrated.add_argument("--calibration", metavar="FILE", help="the sensor's, by midastouch calibrate")
    calibrated.add_argument(
        "--calibrate-with",
        type=limits.count,
        metavar="N",
        help="judge each press with a calibration from N of the others, drawn with --seed",
    )
    parser.add_argument(
        "--check-labels",
        action="store_true",
        help="judge the labels too: by the ball where one light for all presses puts it; and the network by that ball",
    )
    parser.add_argument("--seed", type=limits.seed, default=0, help="default 0")


def _add_gel_options(parser: argparse.ArgumentParser) -> None:
    options.add_meshes_options(parser)
    parser.add_argument("--touches", type=limits.count, default=20, help="on each object (default 20)")
    parser.add_argument("--presses", type=limits.count, default=50, help="of balls and of flat faces (default 50)")
    parser.add_argument("--seed", type=limits.seed, default=0, help="of touches and presses (default 0)")


def _add_ramps_options(parser: argparse.ArgumentParser) -> None:
    options.add_tdn_option(parser)
    parser.add_argument("--presses", type=limits.count, default=40, help="of each shape (default 40)")
    parser.add_argument("--seed", type=limits.seed, default=0, help="of noise and tilts (default 0)")


def _add_checks_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("backgrounds", metavar="DIR", help="no-contact images of many DIGITs")
    parser.add_argument("--sensors", type=limits.count, default=40, help="imaginary sensors (default 40)")
    parser.add_argument(
        "--presses",
        nargs="+",
        default=(),
        metavar="DIR",
        help="presses of a ball on real DIGITs, as the report presses",
    )
    parser.add_argument("--colour-table", metavar="NPZ", help="Taxim's table, if the network was trained with it")
    options.add_sensor_option(parser, options.SIMULATED)
    options.add_tdn_option(parser)
    parser.add_argument("--seed", type=limits.seed, default=0, help="of sensors and touches (default 0)")


def _add_guards_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("backgrounds", metavar="DIR", help="no-contact images of many DIGITs")
    options.add_meshes_options(parser)
    parser.add_argument(
        "--slides", type=limits.count, default=40, help="of each of three kinds of sensors (default 40)"
    )
    parser.add_argument("--seed", type=limits.seed, default=0, help="of sensors, slides and seams (default 0)")


_FORMER = ("tdn", "presses", "gel", "checks")
_REPORTS = {
    "tdn": (
        "depth_quality",
        _add_tdn_options,
        "measure the depth network on sequences with ground truth",
        "midastouch evaluate-perception tdn ../shared/data/ycb_slide_sim/*/00 --json out/tdn.json",
        "Root mean square error over all pixels and over the touched ones, and how well the contact is\noutlined.",
    ),
    "presses": (
        "press_truth",
        _add_presses_options,
        "check the depth network on real presses of a ball of known size",
        "midastouch evaluate-perception presses ../shared/data/digit_real/sphere_presses_d20641 --ball-diameter 0.0088 "
        "--px-per-mm 18.68 --json out/presses.json",
        "DIR holds images of presses and, if there are, the no-contact image background.png (else it is made from the\n"
        "presses) and labelled contact circles, circles.csv with the columns frame,center_x_px,center_y_px,radius_px.\n"
        "The outline of a contact tells how deep a ball of that size was pressed; the measured map is compared with\n"
        "that ball. Without labels the images tell the outline: where one light for five or more presses explains\n"
        "them best. Where that fails, depth is not judged. Images that show no press are named and left out.\n"
        "recall: presses in which a contact is found; bulging: contacts that are round as a ball is, not hollow;\n"
        "roundness: the contact's area over that of the smallest circle around it; by 10 % of light: how much a map\n"
        "changes if its image is that much brighter or darker, root mean square.",
    ),
    "gel": (
        "soft_gel",
        _add_gel_options,
        "measure what soft gel does to penetration maps, depth, poses and codes",
        "midastouch evaluate-perception gel --touches 20 --json out/gel.json",
        "Touches at known poses and presses of known depth, seen by the sensors whose optics were measured,\n"
        "uncalibrated and calibrated, through gel that sinks in as an elastic layer does, 1.5, 3 and 6 mm thick, and\n"
        "as every other evaluation has it.",
    ),
    "checks": (
        "real_gel_checks",
        _add_checks_options,
        "measure false and missed alarms of the fit check, the contact decision and the background capture",
        "midastouch evaluate-perception checks ../shared/data/digit_backgrounds --json out/checks.json",
        "On imaginary sensors as the depth network is trained on, over real no-contact images, and on those\n"
        "images themselves. Light touches are on an eyebolt and on a wire 2 mm thick. --presses adds real sensors.",
    ),
    "ramps": (
        "ramps",
        _add_ramps_options,
        "count what is pressed and not felt, or read as shallower while the press grows",
        "midastouch evaluate-perception ramps --json out/ramps.json",
        "A flat face, a cylinder, a ball and an edge, pressed by 0.2 to 2.5 mm and back at 3 mm a second, at 30 and\n"
        "60 images a second, straight or tilted by up to 3 degrees: in the light of a real DIGIT, and of a GelSight\n"
        "Mini with the calibration of its kind and without.",
    ),
    "guards": (
        "guard_quality",
        _add_guards_options,
        "measure which good and which damaged frames are refused before anything reads them",
        "midastouch evaluate-perception guards ../shared/data/digit_backgrounds --json out/guards.json",
        "Slides of imaginary sensors as the depth network is trained on, over real no-contact images, 0.5, 1.5 and\n"
        "3 mm from one frame to the next: as they are, torn at random rows and columns, rolled, turned and swapped.",
    ),
}
"""Module that measures a report, its options, and its texts: summary, example and details."""
