"""`midastouch inspect`: a finished run in three dimensions, in a window, as pictures, or as files of clouds."""

from __future__ import annotations

import argparse

from midastouch_common.missing_modules import install_extra

from . import arguments


def add_parser(subparsers) -> None:
    """Add the sub-command."""
    parser = arguments.add_command(
        subparsers,
        "inspect",
        run,
        "look at a finished run: object, particles, modes, contact and paths, with a slider for the time",
        "midastouch inspect out/demo/run.mcap\n"
        "  midastouch inspect out/demo/run.mcap --save out/demo/inspect\n"
        "  midastouch inspect out/drill.json --export out/drill",
        "Takes a bag with results, of the demo or the recorder, or a result of `midastouch evaluate`, which has\n"
        "the published poses alone. Without --save and --export it opens a window. --save needs no display.\n"
        f"Needs Open3D: {install_extra('open3d')}.",
    )
    parser.add_argument("run_or_bag", metavar="RUN_OR_BAG", help="bag, or JSON file of midastouch evaluate")
    parser.add_argument("--mesh", help="file or bundled object (default: what the run says)")
    parser.add_argument("--sequence", help="of a JSON file with several")
    parser.add_argument("--sensor", default="digit_tacto", help="sensor model (default digit_tacto)")
    parser.add_argument("--at", type=int, metavar="N", help="moment, from 0; -1: the last (default: all, shown from 0)")
    parser.add_argument("--save", metavar="FILE.png|DIR", help="draw to a file (the last moment), or all to a folder")
    parser.add_argument("--export", metavar="DIR", help="write mesh, clouds and lines to a folder")
    parser.add_argument("--clouds", choices=("ply", "pcd"), default="ply", help="format of exported clouds (ply)")


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    from pathlib import Path

    from midastouch_common.errors import InputError
    from midastouch_common.files import atomic_path, require_new_folder

    from ..inspection import geometry, pictures, require_open3d, window
    from ..inspection.run import load

    pictures_to = require_new_folder(args.save) if args.save and not Path(args.save).suffix else None
    shapes_to = require_new_folder(args.export) if args.export else None
    inspected = load(args.run_or_bag, args.sequence, args.sensor)
    if not (args.mesh or inspected.mesh):
        raise InputError(f"{args.run_or_bag}: does not say which object it is; give its --mesh")
    mesh, count = arguments.load_mesh(args.mesh or inspected.mesh), len(inspected.moments)
    if args.at is not None and not -count <= args.at < count:
        raise InputError(f"--at {args.at}: {args.run_or_bag} has the moments 0 to {count - 1}")
    chosen = range(count) if args.at is None else [args.at % count]
    require_open3d()  # after the checks of the input, which no installation fixes
    if args.save and Path(args.save).suffix:
        pictures.save(inspected, mesh, {chosen[-1]: Path(args.save)})
        print(args.save)
    elif pictures_to:
        with atomic_path(pictures_to) as folder:
            folder.mkdir()
            pictures.save(inspected, mesh, {i: folder / f"{i:04d}.png" for i in chosen})
        print(args.save)
    if shapes_to:
        with atomic_path(shapes_to) as folder:
            folder.mkdir()
            files = geometry.export(inspected, mesh, chosen, folder, args.clouds)
        print(f"{args.export}: {files} files")
    if not (args.save or args.export):
        window.show(inspected, mesh, chosen[0])
    return 0
