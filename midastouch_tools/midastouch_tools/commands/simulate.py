"""`midastouch simulate`: a slide over a mesh as a YCB-Slide sequence folder."""

from __future__ import annotations

import argparse
import sys

from . import arguments, limits


def add_parser(subparsers) -> None:
    """Add the sub-command."""
    parser = arguments.add_command(
        subparsers,
        "simulate",
        run,
        "simulate a slide over an object and write it as a YCB-Slide sequence",
        "midastouch simulate handle_tool --out out/slides/handle_tool/00 --length 0.5 --seed 1",
        "The folder holds tactile images, height maps, contact masks, poses with and without tracking noise\n"
        "(0.5 mm, 1 deg) and the sensor's no-contact image.",
    )
    parser.add_argument("mesh", metavar="MESH", help="mesh file in metres (PLY, STL, OBJ) or a bundled object's name")
    arguments.add_place(parser, "--out", "folder", "sequence folder to write; must not exist", required=True)
    parser.add_argument("--length", type=limits.path_length, default=0.5, help="of the path, m (default 0.5)")
    parser.add_argument("--seed", type=limits.seed, default=0, help="of path, noise and lighting (default 0)")
    parser.add_argument("--sensor", default="digit_tacto", help="sensor model (default digit_tacto)")


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    from midastouch_common.files import atomic_path, require_new
    from midastouch_perception.mesh_report import MeshReport
    from midastouch_perception.sensor_model import SensorModel

    from ..datasets.slide_simulation import simulate_sequence
    from ..text_table import counted

    require_new(args.out, "folder")
    mesh, sensor = arguments.load_mesh(args.mesh), SensorModel.load(args.sensor)
    MeshReport.tell(mesh, sensor, lambda line: print(line, file=sys.stderr))
    with atomic_path(args.out) as folder:
        frames = simulate_sequence(mesh, sensor, args.length, args.seed, folder, progress=True)
        require_new(args.out, "folder")  # another call may have made it meanwhile
    print(f"{args.out}: {counted(frames, 'frame')} of {mesh.name}")
    return 0
