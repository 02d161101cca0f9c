"""`midastouch evaluate-presses`: the depth network on real images of a pressed ball."""

from __future__ import annotations

import argparse

from . import arguments


def add_parser(subparsers) -> None:
    """Add the sub-command."""
    parser = arguments.add_command(
        subparsers,
        "evaluate-presses",
        run,
        "check the depth network on real presses of a ball, whose penetration nobody knows",
        "midastouch evaluate-presses ../shared/data/digit_real/ball_presses --json out/presses.json",
        "A sphere is fitted to what the network feels in each press: is it one ball in all of them, equally\n"
        "curved in all directions, with a round outline, and nothing felt elsewhere?",
    )
    parser.add_argument("folder", metavar="DIR", help="images of presses and their no-contact image, background.png")
    parser.add_argument("--sensor", default="digit_real", help="sensor model (default digit_real)")
    parser.add_argument("--tdn", default="fast", metavar="NET", help="depth network, name or file (default fast)")
    parser.add_argument("--json", metavar="OUT", help="write the results here")


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    from pathlib import Path

    from midastouch_perception.sensor_model import SensorModel
    from midastouch_perception.tdn import load_tdn

    from ..evaluation.machine import machine_info
    from ..evaluation.press_quality import load_presses, measure_presses
    from ..evaluation.result_file import to_json, write_json
    from ..progress import progress_bar

    presses, background = load_presses(args.folder)
    tdn = load_tdn(args.tdn, SensorModel.load(args.sensor))
    with progress_bar(total=len(presses), unit="press") as bar:
        rows, summary = measure_presses(tdn, presses, background, bar.update)
    result = {
        "folder": str(Path(args.folder).resolve()),
        "tdn": args.tdn,
        "network": tdn.network_id,
        "sensor": args.sensor,
        "machine": machine_info(),
        "presses": rows,
        "summary": summary,
    }
    result = to_json(result)
    if args.json:
        write_json(args.json, result)
    print(_table(result["summary"]))
    return 0


def _table(summary: dict) -> str:
    from ..evaluation.table import number, text_table

    spread = summary["radius_spread"]
    rows = [
        ["presses", summary["presses"]],
        ["contact found", f"{100 * summary['found_share']:.0f} %"],
        ["relief bulges towards the camera", f"{100 * summary['bulges_share']:.0f} %"],
        ["radius of the ball, median", f"{number(summary['radius_mm'], 2)} mm"],
        ["its spread over the presses", "-" if spread is None else f"{100 * spread:.0f} %"],
        ["distance from the sphere, RMS", f"{number(summary['residual_mm'], 3)} mm"],
        ["smaller over larger curvature", number(summary["curvature_ratio"], 2)],
        ["roundness of the outline", number(summary["roundness"], 2)],
        ["penetration felt outside contact and shadow", f"{100 * summary['outside_share']:.0f} %"],
        ["image explained by the relief", f"{100 * (summary['explained_share'] or 0):.0f} %"],
        ["against the ball rendered: RMSE, all pixels", f"{number(summary['ball_rmse_mm'], 3)} mm"],
        ["against the ball rendered: IoU of contact", number(summary["ball_iou"], 2)],
    ]
    return text_table(["median over presses", "value"], rows)
