"""`midastouch calibrate`: what one DIGIT's colours say of slopes, from presses of a ball."""

from __future__ import annotations

import argparse
from pathlib import Path

from midastouch_perception.errors import InputError

from . import arguments


def add_parser(subparsers) -> None:
    """Add the sub-command."""
    parser = arguments.add_command(
        subparsers,
        "calibrate",
        run,
        "learn how deep a DIGIT's colours are from 5 to 40 presses of a ball",
        "midastouch calibrate live --ball-diameter 0.006 --serial D20123",
        "Press one ball straight onto the gel, in ten places spread over it, and save an image of each. Nothing\n"
        "has to be labelled: the contacts are found, and presses that cannot be used are named with the reason. DIR\n"
        "may hold the no-contact image as background.png; else it is made of the images. The result is\n"
        "cross-validated. With --serial it is kept beside the sensor's no-contact image, and the node tdn uses it at\n"
        "its next start. live instead of DIR: guides through the presses of a running sensor, whose no-contact image\n"
        "was captured.",
    )
    parser.add_argument("folder", metavar="DIR", help="images of the presses (PNG or JPEG), or live")
    parser.add_argument(
        "--ball-diameter", type=arguments.positive, required=True, metavar="METRES", help="diameter of the ball"
    )
    parser.add_argument("--serial", default="", metavar="SERIAL", help="serial number of the sensor")
    parser.add_argument("--out", metavar="FILE", help="write the calibration here (default: keep it for --serial)")
    parser.add_argument("--background-folder", default="", metavar="DIR", help="where sensors' images are kept")
    parser.add_argument("--sensor", default="digit_real", help="sensor model (default digit_real)")
    parser.add_argument(
        "--px-per-mm", type=arguments.positive, metavar="X", help="scale of this very sensor (default: the model's)"
    )
    parser.add_argument("--save", metavar="DIR", help="of live presses (default out/presses/SERIAL)")
    parser.add_argument(
        "--optics",
        metavar="FILE",
        help="write here how the sensor's images answer to the shape of its gel (JSON, as the sensors behind "
        "midastouch benchmark --protocol real_sensor)",
    )
    parser.add_argument("--page", metavar="DIR", help="write a page here that shows every press before and after")


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    from midastouch_perception.ball_calibration.fit import calibrate
    from midastouch_perception.sensor_model import SensorModel
    from midastouch_perception.tdn.background_store import store_of

    from ..evaluation.table import text_table

    store = store_of(args.background_folder, args.serial)
    if store is None and not args.out:
        raise InputError("nowhere to keep the calibration; give the sensor's --serial, or a file with --out")
    sensor = SensorModel.load(args.sensor)
    if args.px_per_mm:
        sensor = sensor.at_scale(1e3 * args.px_per_mm)
    folder = Path(args.folder)
    if args.folder == "live":
        folder = Path(args.save or f"out/presses/{args.serial}")
        if not _collect(args, store, sensor, folder):
            return 1
    images, background = _read(folder)
    result = calibrate(images, background, args.ball_diameter, sensor, args.serial)
    path = Path(args.out) if args.out else store.calibration_path
    result.calibration.save(path)
    if args.optics:
        _measure_optics(args, images, result)
    for press in result.presses:
        if press.problem:
            print(f"{press.name}: not used: {press.problem}")
    figures = result.figures
    rows = [
        [
            f"radius of the ball by the colours, {500 * args.ball_diameter:g} mm in truth",
            f"{1e3 * figures['felt_radius_before']:.1f} mm",
            f"{1e3 * figures['felt_radius_after']:.1f} mm",
        ],
        [
            "slopes of the ball explained",
            f"{100 * figures['explained_before']:.0f} %",
            f"{100 * figures['explained_after']:.0f} %",
        ],
    ]
    print(text_table(["on presses not calibrated with, median", "before", "after"], rows))
    if args.page:
        from ..report.calibration import calibration_page

        print(f"{calibration_page(result, images, sensor, Path(args.page))}: before and after")
    print(f"{path}: calibration from {result.calibration.presses} presses")
    return 0


def _measure_optics(args: argparse.Namespace, images: dict, result) -> None:
    from midastouch_perception.simulation.optics_fit import fit_optics

    optics = fit_optics(Path(args.optics).stem, args.command_line, images, result)
    optics.save(args.optics)
    print(f"{args.optics}: explains {100 * optics.explained:.0f} % of the change in presses that it has not seen")


def _read(folder: Path):
    """Images by file name and the no-contact image or None."""
    from ..datasets.sequence import read_image

    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; name a folder of images of presses")
    paths = sorted(p for p in folder.iterdir() if p.suffix.lower() in (".png", ".jpg", ".jpeg"))
    images = {path.name: read_image(path) for path in paths}
    background = images.pop("background.png", None)
    if not images:
        raise InputError(f"{folder}: no images (PNG or JPEG) of presses in it")
    return images, background


def _collect(args: argparse.Namespace, store, sensor, folder: Path) -> bool:
    """Save presses of the running sensor and its no-contact image in a folder; whether all were taken."""
    import cv2

    from midastouch_perception.ball_calibration.collector import PressCollector
    from midastouch_perception.files import atomic_path

    try:
        from midastouch_perception.ros import spin

        from ..nodes.press_collection import PressCollection
    except ImportError as error:
        raise InputError(f"{error}; run midastouch doctor to see what is missing") from error

    if store is None:
        raise InputError("calibrate live: give the sensor's --serial")
    background = store.load(sensor.height, sensor.width)
    if background is None:
        raise InputError(
            f"{store.path}: no no-contact image of this sensor; start tdn with serial:={args.serial}, lift the finger "
            "and call capture_background"
        )
    collector = PressCollector(background, args.ball_diameter, sensor)
    spin.run(lambda: [PressCollection(collector, sensor, lambda text: print(text, flush=True))], ["calibrate"])
    for name, image in {**collector.images, "background.png": background}.items():
        with atomic_path(folder / name) as path:
            path.write_bytes(cv2.imencode(".png", image[:, :, ::-1])[1].tobytes())
    if not collector.done:
        print(f"{folder}: {len(collector.images)} presses; midastouch calibrate {folder} uses five or more")
    return collector.done
