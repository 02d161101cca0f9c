"""`midastouch build-codebook`: sensor poses all over an object with their tactile codes."""

from __future__ import annotations

import argparse
import zipfile
from pathlib import Path

from midastouch_common.output_paths import codebook_path

from . import arguments, limits


def add_parser(subparsers) -> None:
    """Add the sub-command."""
    parser = arguments.add_command(
        subparsers,
        "build-codebook",
        run,
        "build the codebook of an object, or of many: poses all over it and what the sensor would measure there",
        "midastouch build-codebook meshes/035_power_drill.ply --size 50000",
        "When it is interrupted, the same command continues where it stopped. A codebook that is up to date is kept.\n"
        "Of several meshes a worker takes one at a time.",
    )
    parser.add_argument(
        "mesh", metavar="MESH", nargs="+", help="mesh file in metres (PLY, STL, OBJ) or a bundled object's name"
    )
    what = "file, of several meshes folder (default: out/codebooks/<mesh name>.npz)"
    arguments.add_place(parser, "--out", "file or folder", what)
    parser.add_argument("--size", type=limits.poses, default=50_000, help="number of poses (default 50000)")
    parser.add_argument("--seed", type=limits.seed, default=0, help="of the poses (default 0)")
    parser.add_argument("--force", action="store_true", help="build again what is up to date")
    arguments.add_jobs_option(parser)
    parser.add_argument(
        "--symmetries",
        metavar="FILE[:ID]",
        help="the object's symmetry, as in a BOP models_info.json (lengths in mm); default: it is found",
    )
    parser.add_argument("--sensor", default="digit_tacto", help="sensor model (default digit_tacto)")
    parser.add_argument("--tcn", default="fast", metavar="NET", help="code network, name or file (default fast)")


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    from midastouch_common.errors import InputError
    from midastouch_common.files import require_place
    from midastouch_perception.sensor_model import SensorModel
    from midastouch_perception.symmetry.bop import symmetry_of_bop
    from midastouch_perception.tcn import load_tcn

    from ..codebooks import build_from_files
    from ..jobs import open_workers

    meshes = [arguments.load_mesh(name) for name in args.mesh]
    load_tcn(args.tcn, SensorModel.load(args.sensor))  # a wrong name ends the command before there are workers
    symmetry = symmetry_of_bop(args.symmetries) if args.symmetries else None
    what = args.tcn, args.sensor, args.size, args.seed
    if len(meshes) > 1 or (args.out and args.out.is_dir()):
        if symmetry:
            raise InputError("--symmetries: is of one object; build the codebooks of several meshes one by one")
        names = [mesh.name for mesh in meshes]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise InputError(f"{', '.join(twice)}: several meshes of that name, whose codebooks would be one file")
        folder = (args.out or codebook_path("").parent).resolve()
        outs = [require_place(folder / codebook_path(name, args.sensor).name) for name in names]
        tasks = [(mesh.path, *what, out, args.force, 1, None) for mesh, out in zip(meshes, outs, strict=True)]
        with open_workers(args.jobs) as workers:
            for line in workers.map(build_from_files, tasks):
                print(line)
        return 0
    out = require_place(args.out or codebook_path(meshes[0].name, args.sensor))
    if out.is_file() and not zipfile.is_zipfile(out):
        raise InputError(f"{out}: exists and is no codebook; choose another name")
    if out.is_file() and (other := _mesh_of(out)) not in ("", meshes[0].name):
        raise InputError(f"{out}: exists, and is the codebook of '{other}'; choose another name")
    print(build_from_files(meshes[0].path, *what, out, args.force, args.jobs, symmetry))
    return 0


def _mesh_of(codebook: Path) -> str:
    """Return the name of the mesh that a codebook is of; empty if it cannot be read, and is built again."""
    from midastouch_common.errors import InputError
    from midastouch_perception.codebook import Codebook

    try:
        return Codebook.load(codebook, first=1).meta["mesh_name"]
    except InputError:
        return ""
