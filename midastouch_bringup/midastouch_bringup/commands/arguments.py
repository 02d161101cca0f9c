"""What the commands share: parser set-up, value checks, where meshes and codebooks are found."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from midastouch_common.errors import InputError
from midastouch_filter.core.presets import PRESETS_IN_WORDS

from ..output_paths import SIMULATED, codebook_path

if TYPE_CHECKING:
    from midastouch_common.mesh import ObjectMesh
    from midastouch_perception.codebook import Codebook

    from ..bags.frames import GelStream
    from ..evaluation.setup import Networks


def add_command(subparsers, name: str, run: Callable, summary: str, example: str, details: str):
    """Add a sub-command with its one-line summary, longer text and example; returns its parser."""
    parser = subparsers.add_parser(
        name,
        help=summary,
        description=f"{summary[0].upper()}{summary[1:]}.\n\n{details}".rstrip(),
        epilog=f"example:\n  {example}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.set_defaults(run=run)
    return parser


def add_network_options(parser: argparse.ArgumentParser, sensor: str = SIMULATED) -> None:
    """Add --tdn, --tcn and --sensor, with which `Networks.load` is called; sensor: the default, "" the sequences'."""
    parser.add_argument("--tdn", default="fast", metavar="NET", help="depth network, name or file (default fast)")
    parser.add_argument("--tcn", default="fast", metavar="NET", help="code network, name or file (default fast)")
    add_sensor_option(parser, sensor)


def add_sensor_option(parser: argparse.ArgumentParser, default: str) -> None:
    """Add --sensor; default: "" for the one that the sequences were recorded with."""
    words = default or "the one that the sequences were recorded with"
    parser.add_argument("--sensor", default=default, help=f"sensor model (default {words})")


def add_sequence_options(parser: argparse.ArgumentParser) -> None:
    """Add --background and --calibration, which `untouched_of` and the networks are given."""
    parser.add_argument(
        "--background", metavar="IMAGE", help="no-contact image of the sensor (default: the sequence's, else estimated)"
    )
    parser.add_argument("--calibration", metavar="FILE", help="the sensor's, by midastouch calibrate (default: none)")


def add_filter_options(parser: argparse.ArgumentParser) -> None:
    """Add --config and --preset, with which `load_filter_config` is called."""
    parser.add_argument("--config", metavar="YAML", help="filter settings, or a ROS parameter file")
    parser.add_argument(
        "--preset",
        metavar="NAME",
        help=f"filter settings between run time and error ({PRESETS_IN_WORDS}); those in --config go over them",
    )


def add_bag_options(parser: argparse.ArgumentParser, base_frame: str = "base_link") -> None:
    """Add --image-topic, --base-frame and --gel-frame: what `gel_stream` takes."""
    for option, default, metavar, what in (
        ("--image-topic", "/image_raw", "TOPIC", "images of the bag"),
        ("--base-frame", base_frame, "FRAME", "what the sensor's poses in the bag are told in"),
        ("--gel-frame", "digit_gel_frame", "FRAME", "the sensor's, in the bag"),
    ):
        parser.add_argument(option, default=default, metavar=metavar, help=f"{what} (default {default})")


def gel_stream(args: argparse.Namespace) -> GelStream:
    """What these options name."""
    from ..bags.frames import GelStream

    return GelStream(args.image_topic, args.base_frame, args.gel_frame)


def add_cluster_options(parser: argparse.ArgumentParser) -> None:
    """--jobs and --cluster."""
    parser.add_argument(
        "--jobs",
        type=positive_int,
        default=len(os.sched_getaffinity(0)),
        metavar="N",
        help="at a time on this machine (default: one per core)",
    )
    parser.add_argument("--cluster", metavar="ADDRESS", help="of a Dask scheduler, such as tcp://10.0.0.1:8786")


def positive_int(text: str) -> int:
    """argparse type: a whole number of at least 1."""
    return int(_checked(text, int, lambda value: value >= 1, "a whole number of at least 1"))


def port(text: str) -> int:
    """argparse type: a TCP port that needs no privileges."""
    return int(_checked(text, int, lambda value: 1024 <= value <= 65535, "a port in 1024...65535"))


def seed(text: str) -> int:
    """argparse type: a whole number of at least 0."""
    return int(_checked(text, int, lambda value: value >= 0, "a whole number of at least 0"))


def positive(text: str) -> float:
    """argparse type: a finite number above 0."""
    return _checked(text, float, lambda value: 0 < value < float("inf"), "a number above 0")


def _checked(text: str, kind: type, holds: Callable, wanted: str):
    try:
        value = kind(text)
    except ValueError:
        value = None
    if value is None or not holds(value):
        raise argparse.ArgumentTypeError(f"{text!r} is not {wanted}")
    return value


def load_mesh(name_or_path: str) -> ObjectMesh:
    """The mesh at a path, or a bundled object by its name."""
    from midastouch_common.mesh import ObjectMesh
    from midastouch_perception.objects import bundled_objects

    bundled = bundled_objects()
    if not Path(name_or_path).is_file() and name_or_path in bundled:
        return ObjectMesh.load(bundled[name_or_path])
    if not Path(name_or_path).is_file() and not Path(name_or_path).suffix:
        raise InputError(f"{name_or_path}: no such mesh file, nor a bundled object ({', '.join(sorted(bundled))})")
    return ObjectMesh.load(name_or_path)


def load_object(
    object_name: str, mesh: str | None, codebook: str | None, networks: Networks
) -> tuple[ObjectMesh, Codebook]:
    """Mesh and codebook of an object, found by name where no path is given.

    The codebook defaults to the one that `build-codebook` makes of the mesh, else to the object's, the mesh to the file
    the codebook was built from. Raises InputError that says what to run or to give when one is not found, or when they
    do not belong together.
    """
    from midastouch_perception.codebook import Codebook

    # a trial's mesh seldom has the trial's name: it is that object in the recording's frame
    names = [Path(mesh).stem, object_name] if mesh else [object_name]
    default = [codebook_path(name, networks.sensor.name) for name in names]
    path = Path(codebook) if codebook else next((each for each in default if each.is_file()), default[0])
    if not path.is_file():
        sensor = "" if networks.sensor.name == SIMULATED else f" --sensor {networks.sensor.name}"
        if codebook:
            raise InputError(
                f"{path}: no such codebook file; build it: midastouch build-codebook MESH{sensor} --out {path}"
            )
        built_from = mesh or f"{object_name}.ply"
        raise InputError(f"{path}: no codebook of {names[0]}; build it: midastouch build-codebook {built_from}{sensor}")
    if mesh is None:
        mesh = Codebook.load(path).meta.get("mesh_path", "")
        if not Path(mesh).is_file():
            raise InputError(f"{path}: its mesh '{mesh}' is not there any more; give it with --mesh")
    loaded = load_mesh(mesh)
    book = Codebook.load(path, mesh=loaded, tcn=networks.tcn.network_id)
    if book.meta["sensor_id"] != networks.sensor.content_id:
        raise InputError(
            f"{path}: built for the sensor {book.meta['sensor']}, not for {networks.sensor.name}; build it again"
        )
    return loaded, book
