"""`midastouch calibrate`: calibration of one DIGIT, from its colours to slopes, by presses of a ball."""

from __future__ import annotations

import argparse
import shlex
from pathlib import Path

from midastouch_common.errors import InputError
from midastouch_common.files import require_folder, require_new_folder, require_place

from . import arguments, limits

_SENSOR = "digit_real"


def add_parser(subparsers) -> None:
    """Add the sub-command."""
    parser = arguments.add_command(
        subparsers,
        "calibrate",
        run,
        "calibrate a sensor: learn from presses of a ball what its colours say of slopes",
        "midastouch calibrate live --ball-diameter 0.006 --serial D20123",
        "Press one ball straight onto the gel, in ten places spread over it, and save an image of each. Nothing\n"
        "has to be labelled: the contacts are found, and presses that cannot be used are named with the reason. The\n"
        "folder may hold the no-contact image as background.png; else that of --serial is taken, or it is made of\n"
        "the images. The result is\n"
        "cross-validated. With --serial it is kept beside the sensor's no-contact image, and the node tdn uses it at\n"
        "its next start. live, or no folder: guides through the presses of a running sensor, whose no-contact\n"
        "image was captured; midastouch view shows where to press.",
    )
    parser.add_argument(
        "source",
        nargs="?",
        default="live",
        metavar="SOURCE",
        help="folder of images of presses (PNG or JPEG), or live (the default)",
    )
    parser.add_argument(
        "--ball-diameter", type=limits.ball_diameter, required=True, metavar="METRES", help="diameter of the ball"
    )
    parser.add_argument(
        "--diameter-is-right",
        action="store_true",
        help="calibrate even if the ball measures like one of another diameter",
    )
    arguments.add_name(parser, "--serial", "serial number", "serial number of the sensor")
    arguments.add_place(parser, "--out", "file", "write the calibration here (default: keep it for --serial)")
    parser.add_argument("--background-folder", default="", metavar="DIR", help="where sensors' images are kept")
    parser.add_argument("--sensor", default=_SENSOR, help=f"sensor model (default {_SENSOR})")
    parser.add_argument(
        "--px-per-mm", type=limits.pixels_per_mm, metavar="X", help="scale of this very sensor (default: the model's)"
    )
    arguments.add_name(parser, "--namespace", "namespace", "of the live sensor")
    new = "new folder for live presses (default out/presses/SERIAL, or SERIAL_2, ...)"
    arguments.add_place(parser, "--save", "folder", new)
    optics = (
        "write here how the sensor's images answer to the shape of its gel (JSON, as the sensors behind "
        "midastouch benchmark --protocol real_sensor)"
    )
    arguments.add_place(parser, "--optics", "file", optics)
    arguments.add_place(parser, "--page", "folder", "write a page here that shows every press before and after")


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    from midastouch_perception.sensor_calibration.calibration import scale_problem
    from midastouch_perception.sensor_model import SensorModel
    from midastouch_perception.tdn.background_store import store_of

    if args.source != "live":
        require_folder(args.source, "of images of presses")
    store = store_of(args.background_folder, args.serial)
    if store is None and not args.out:
        raise InputError("nowhere to keep the calibration; give the sensor's --serial, or a file with --out")
    path = args.out or require_place(store.calibration_path)
    sensor = SensorModel.load(args.sensor)
    if args.px_per_mm:
        model, sensor = sensor, sensor.at_scale(1e3 * args.px_per_mm)
        # tdn has the model's scale and would not use the calibration
        if not args.out and (problem := scale_problem(model, sensor.pixel_size)):
            raise InputError(f"--px-per-mm {args.px_per_mm:g}: {problem}")
    if args.source == "live":
        result, images, code = _live(args, path)
        if result is None:
            return code
    else:
        result, images = _of_presses(args, store, sensor)
    if args.optics:
        from midastouch_simulation.optics_fit import fit_optics

        optics = fit_optics(args.optics.stem, args.command_line, images, result)
        optics.save(args.optics)
        print(f"{args.optics}: explains {100 * optics.explained:.0f} % of the change in touches that it has not seen")
    _report(args, result, images, sensor)
    # last, so that a failure above keeps nothing; for a live sensor the guide has saved it already
    if args.source != "live":
        result.calibration.save(path)
    print(f"{path}: calibration from {result.calibration.touched}")
    return 0


def _of_presses(args: argparse.Namespace, store, sensor):
    from midastouch_perception.sensor_calibration.fit import calibrate

    from ..datasets.ball_presses import read_presses

    images, background = read_presses(Path(args.source))
    if background is None and store and (background := store.load(sensor.height, sensor.width)) is not None:
        print(f"{store.path}: taken for the no-contact image; {args.source} holds none")
    try:
        return calibrate(images, background, args.ball_diameter, sensor, args.serial, args.diameter_is_right), images
    except InputError as error:
        raise InputError(f"{args.source}: {error}") from error


def _live(args: argparse.Namespace, path: Path):
    """Calibrate the running sensor and save at `path`; return result, images of the presses and exit code. The result
    is None if the guide was ended before the last press or if the presses cannot be used."""
    from midastouch_common.ros import spin
    from midastouch_perception.nodes.calibrate import CalibrateNode

    from ..processes.foreground import handlers_kept

    if not args.serial:
        raise InputError("calibrate live: give the sensor's --serial")
    folder = require_new_folder(args.save) if args.save else f"out/presses/{args.serial}"
    parameters = {
        "serial": args.serial,
        "ball_diameter": args.ball_diameter,
        "diameter_is_right": args.diameter_is_right,
        "sensor_model": args.sensor,
        "px_per_mm": args.px_per_mm or 0.0,
        "background_folder": args.background_folder,
        "out": str(path),
        "presses_folder": str(folder),
    }
    made: list[CalibrateNode] = []

    def guide() -> list[CalibrateNode]:
        made.append(CalibrateNode(lambda text: print(text, flush=True), once=True))
        return made

    with handlers_kept():  # drawing a page takes time
        spin.run(guide, arguments.ros_arguments("calibrate", parameters, args.namespace))
    if not made:
        return None, {}, 2
    (node,) = made
    if node.result is None:
        print(f"{node.presses_folder}: {len(node.images)} presses; to calibrate from five or more of them:")
        print(shlex.join(_from_folder(args, node.presses_folder)))
        return None, {}, 2 if node.failure else 1
    return node.result, node.images, 0


def _from_folder(args: argparse.Namespace, folder: Path) -> list[str]:
    """Return the command that calibrates from the images that were taken live."""
    words = ["midastouch", "calibrate", str(folder), "--ball-diameter", f"{args.ball_diameter:g}"]
    for name in ("serial", "out", "background_folder", "px_per_mm", "optics", "page"):
        if value := getattr(args, name):
            words += [f"--{name.replace('_', '-')}", str(value)]
    if args.sensor != _SENSOR:
        words += ["--sensor", args.sensor]
    if args.diameter_is_right:
        words.append("--diameter-is-right")
    return words


def _report(args: argparse.Namespace, result, images, sensor) -> None:
    """Print the unused presses, the errors before and after, and warnings; write the page if it is wanted."""
    from ..drawing.calibration import calibration_page, figure_rows
    from ..text_table import text_table

    for press in result.presses:
        if press.problem:
            print(f"{press.name}: not used: {press.problem}")
    print(text_table(["on touches not calibrated with, median", "before", "after", "truth"], figure_rows(result)))
    for warning in result.warnings if args.source != "live" else ():  # the guide has printed them
        print(f"warning: {warning}")
    if args.page:
        print(f"{calibration_page(result, images, sensor, args.page)}: before and after")
