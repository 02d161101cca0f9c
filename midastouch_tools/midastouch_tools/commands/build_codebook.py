"""`midastouch build-codebook`: sensor poses all over an object with their tactile codes."""

from __future__ import annotations

import argparse
import zipfile

from midastouch_common.output_paths import codebook_path

from . import arguments


def add_parser(subparsers) -> None:
    """Add the sub-command."""
    parser = arguments.add_command(
        subparsers,
        "build-codebook",
        run,
        "build the codebook of an object, or of many: poses all over it and what the sensor would measure there",
        "midastouch build-codebook meshes/035_power_drill.ply --size 50000",
        "When it is interrupted, the same command goes on where it stopped. A codebook that is up to date is kept.\n"
        "Of several meshes a worker takes one at a time.",
    )
    parser.add_argument(
        "mesh", metavar="MESH", nargs="+", help="mesh file in metres (PLY, STL, OBJ) or a bundled object's name"
    )
    parser.add_argument(
        "--out", metavar="PATH", help="file, of several meshes folder (default: out/codebooks/<mesh name>.npz)"
    )
    parser.add_argument("--size", type=arguments.positive_int, default=50_000, help="number of poses (default 50000)")
    parser.add_argument("--seed", type=arguments.seed, default=0, help="of the poses (default 0)")
    parser.add_argument("--force", action="store_true", help="build again what is up to date")
    arguments.add_cluster_options(parser)
    parser.add_argument(
        "--symmetries",
        metavar="FILE[:ID]",
        help="the object's symmetry, as in a BOP models_info.json (lengths in mm); default: it is found",
    )
    parser.add_argument("--sensor", default="digit_tacto", help="sensor model (default digit_tacto)")
    parser.add_argument("--tcn", default="fast", metavar="NET", help="code network, name or file (default fast)")


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    from pathlib import Path

    from midastouch_common.errors import InputError
    from midastouch_common.files import require_place
    from midastouch_perception.sensor_model import SensorModel
    from midastouch_perception.symmetry.bop import symmetry_of_bop
    from midastouch_perception.tcn import load_tcn

    from ..cluster import open_cluster
    from ..codebooks import build_and_save, build_catalogue, described, is_up_to_date, kept

    meshes = [arguments.load_mesh(name) for name in args.mesh]
    sensor = SensorModel.load(args.sensor)
    tcn = load_tcn(args.tcn, sensor)
    symmetry = symmetry_of_bop(args.symmetries) if args.symmetries else None
    if len(meshes) > 1 or args.cluster or (args.out and Path(args.out).is_dir()):
        if symmetry:
            raise InputError("--symmetries: is of one object; build the codebooks of several meshes one by one")
        names = [mesh.name for mesh in meshes]
        if twice := {name for name in names if names.count(name) > 1}:
            raise InputError(
                f"{', '.join(sorted(twice))}: several meshes of that name, whose codebooks would be one file"
            )
        folder = (Path(args.out) if args.out else codebook_path("").parent).resolve()  # workers may run elsewhere
        for name in names:
            require_place(folder / codebook_path(name, args.sensor).name)
        paths = [mesh.path for mesh in meshes]
        with open_cluster(args.jobs, args.cluster) as cluster:
            what = args.tcn, args.sensor, args.size, args.seed
            for line in build_catalogue(paths, *what, folder, cluster, args.force):
                print(line)
        return 0
    out = require_place(args.out or codebook_path(meshes[0].name, args.sensor))
    if out.is_file() and not zipfile.is_zipfile(out):
        raise InputError(f"{out}: exists and is no codebook; choose another name")
    one = meshes[0], tcn, sensor, args.size, args.seed
    if not args.force and is_up_to_date(out, *one, symmetry):
        print(kept(out))
    else:
        print(described(out, *build_and_save(*one, out, args.jobs, symmetry)))
    return 0
