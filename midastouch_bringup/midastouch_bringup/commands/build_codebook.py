"""`midastouch build-codebook`: sensor poses all over an object with their tactile codes."""

from __future__ import annotations

import argparse

from ..output_paths import codebook_path
from . import arguments


def add_parser(subparsers) -> None:
    """Add the sub-command."""
    parser = arguments.add_command(
        subparsers,
        "build-codebook",
        run,
        "build the codebook of an object: poses all over it and what each would feel like",
        "midastouch build-codebook meshes/035_power_drill.ply --size 50000",
        "When it is interrupted, the same command goes on where it stopped.",
    )
    parser.add_argument("mesh", metavar="MESH", help="mesh file in metres (PLY, STL, OBJ) or a bundled object's name")
    parser.add_argument("--out", metavar="FILE", help="default: out/codebooks/<mesh name>.npz")
    parser.add_argument("--size", type=arguments.positive_int, default=50_000, help="number of poses (default 50000)")
    parser.add_argument("--seed", type=arguments.seed, default=0, help="of the poses (default 0)")
    parser.add_argument("--jobs", type=arguments.positive_int, metavar="N", help="threads (default: one per core)")
    parser.add_argument("--sensor", default="digit_tacto", help="sensor model (default digit_tacto)")
    parser.add_argument("--tcn", default="fast", metavar="NET", help="code network, name or file (default fast)")


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    from pathlib import Path

    from midastouch_perception.sensor_model import SensorModel
    from midastouch_perception.tcn import load_tcn

    from ..codebooks import build_and_save
    mesh = arguments.load_mesh(args.mesh)
    out = Path(args.out) if args.out else codebook_path(mesh.name)
    sensor = SensorModel.load(args.sensor)
    tcn = load_tcn(args.tcn, sensor)
    codebook, seconds = build_and_save(mesh, tcn, sensor, args.size, args.seed, out, args.jobs)
    size = out.stat().st_size / 2**20
    print(f"{out}: {len(codebook.poses)} poses of {mesh.name}, {size:.1f} MiB, built in {seconds:.1f} s")
    return 0
