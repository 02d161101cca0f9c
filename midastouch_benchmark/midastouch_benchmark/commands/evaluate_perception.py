"""`midastouch evaluate-perception`: how well the images of a sensor are read, in four reports."""

from __future__ import annotations

import argparse

from midastouch_tools.commands import arguments

from . import options


def add_parser(subparsers) -> None:
    """Add the sub-command with its reports, and the former command of each, which the next release drops."""
    parser = arguments.add_command(
        subparsers,
        "evaluate-perception",
        run,
        "measure how well images are read: depth network, presses of a ball, soft gel, checks",
        "midastouch evaluate-perception checks ../shared/data/digit_backgrounds --json out/checks.json",
        "Each report has --help of its own.",
    )
    reports = parser.add_subparsers(metavar="REPORT", required=True, help="what is measured")
    for report, add in {"tdn": _add_tdn, "presses": _add_presses, "gel": _add_gel, "checks": _add_checks}.items():
        for place, name in ((reports, report), (subparsers, f"evaluate-{report}")):
            added = add(place, name)
            options.add_json_option(added)
            added.set_defaults(report=report)


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    from ..perception import reports

    measure = {"tdn": reports.tdn, "presses": reports.presses, "gel": reports.gel, "checks": reports.checks}
    return options.conclude(args, f"evaluate-perception {args.report}", measure[args.report](args))


def _add_tdn(subparsers, name: str) -> argparse.ArgumentParser:
    parser = arguments.add_command(
        subparsers,
        name,
        run,
        "measure the depth network on sequences with ground truth",
        "midastouch evaluate-perception tdn ../shared/data/ycb_slide_sim/*/00 --json out/tdn.json",
        "Root mean square error over all pixels and over the touched ones, and how well the contact is\noutlined.",
    )
    parser.add_argument("sequences", nargs="+", metavar="SEQ", help="YCB-Slide sequence folders (simulated)")
    options.add_tdn_option(parser)
    options.add_sensor_option(parser, "")
    options.add_sequence_options(parser)
    return parser


def _add_presses(subparsers, name: str) -> argparse.ArgumentParser:
    parser = arguments.add_command(
        subparsers,
        name,
        run,
        "check the depth network on real presses of a ball of known size",
        "midastouch evaluate-perception presses ../shared/data/digit_real/sphere_presses_d20641 --ball-diameter 0.0088 "
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
    return parser


def _add_gel(subparsers, name: str) -> argparse.ArgumentParser:
    parser = arguments.add_command(
        subparsers,
        name,
        run,
        "measure what soft gel does to penetration maps, depth, poses and codes",
        "midastouch evaluate-perception gel --touches 20 --json out/gel.json",
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
    return parser


def _add_checks(subparsers, name: str) -> argparse.ArgumentParser:
    parser = arguments.add_command(
        subparsers,
        name,
        run,
        "measure false and missed alarms of the fit check, the contact decision and the background capture",
        "midastouch evaluate-perception checks ../shared/data/digit_backgrounds --json out/checks.json",
        "On imaginary sensors as the depth network is trained on, over real no-contact images, and on those\n"
        "images themselves. Light touches are on an eyebolt and on a wire 2 mm thick. --presses adds real sensors.",
    )
    parser.add_argument("backgrounds", metavar="DIR", help="no-contact images of many DIGITs")
    parser.add_argument("--sensors", type=arguments.positive_int, default=40, help="imaginary sensors (default 40)")
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
    parser.add_argument("--seed", type=arguments.seed, default=0, help="of sensors and touches (default 0)")
    return parser
