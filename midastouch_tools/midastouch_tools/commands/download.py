"""`midastouch download`: public meshes and recordings."""

from __future__ import annotations

import argparse
from pathlib import Path

from . import arguments


def add_parser(subparsers) -> None:
    """Add the sub-command."""
    parser = arguments.add_command(
        subparsers,
        "download",
        run,
        "download YCB meshes or parts of YCB-Slide",
        "midastouch download ycb-mesh 025_mug 035_power_drill",
        "ycb-mesh NAME...: 16k-face scans (CC BY 4.0), one PLY each. ycb-slide sim|real|backgrounds...: recordings\n"
        "(CC BY-SA 4.0; MIT is the licence of its code alone), with gdown, which continues where an earlier call was\n"
        "stopped. tactile-tracking: where NormalFlow's recordings with a GelSight Mini lie, and what to do with them;\n"
        "nothing is downloaded.",
    )
    parser.add_argument("what", choices=("ycb-mesh", "ycb-slide", "tactile-tracking"), help="which collection")
    parser.add_argument(
        "names", nargs="*", default=[], metavar="NAME", help="objects (025_mug) or parts (sim, real, backgrounds)"
    )
    arguments.add_place(parser, "--out", "folder", "folder (default out/ycb, out/ycb_slide)")
    parser.add_argument("--mirror", metavar="URL", help="take ycb-mesh from a copy of the server's data folder")


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    from midastouch_common.errors import InputError

    if args.what == "tactile-tracking":
        return _tactile_tracking()
    if not args.names:
        raise InputError(f"download {args.what}: name what to download; see midastouch download --help")
    return {"ycb-mesh": _meshes, "ycb-slide": _slides}[args.what](args)


def _tactile_tracking() -> int:
    print(
        "TactileTracking (Huang, Kaess, Yuan, 2024; MIT): 12 objects, 7 trials each, a GelSight Mini under motion\n"
        "capture, at https://huggingface.co/datasets/joehjhuang/TactileTracking\n"
        "Unpack it. The recordings have no mesh: export the object's in the gel frame of the first image. Then\n"
        "  midastouch build-codebook aligned.ply --sensor gelsight_mini\n"
        "  midastouch evaluate avocado0 --mesh aligned.ply --background free.png\n"
        "avocado0 is the folder of a trial, free.png a no-contact image of its sensor."
    )
    return 0


def _meshes(args: argparse.Namespace) -> int:
    from ..download.ycb import SERVER, download_mesh

    folder = args.out or Path("out/ycb")
    for name in args.names:
        print(download_mesh(name, folder, args.mirror or SERVER))
    return 0


def _slides(args: argparse.Namespace) -> int:
    from midastouch_common.errors import InputError

    from ..download.ycb import FOLDERS, download_part

    if unknown := set(args.names) - FOLDERS.keys():
        raise InputError(f"ycb-slide {', '.join(sorted(unknown))}: no such part; there are {', '.join(FOLDERS)}")
    for part in args.names:
        for folder in download_part(part, args.out or Path("out/ycb_slide")):
            print(folder)
    return 0
