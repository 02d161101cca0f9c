"""Options that commands which measure share: networks, sensor, filter settings, and the object."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from midastouch_bringup.commands.arguments import load_mesh
from midastouch_bringup.output_paths import SIMULATED, codebook_path
from midastouch_common.errors import InputError
from midastouch_filter.core.presets import PRESETS_IN_WORDS

if TYPE_CHECKING:
    from midastouch_common.mesh import ObjectMesh
    from midastouch_perception.codebook import Codebook

    from ..trials.setup import Networks


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
