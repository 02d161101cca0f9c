"""`midastouch download`: public meshes and recordings."""

from __future__ import annotations

import argparse
from pathlib import Path

from . import arguments

_TACTILE_TRACKING = """\
TactileTracking (Huang, Kaess, Yuan, 2024; MIT): 12 objects, 7 trials each, a GelSight Mini under motion
capture, at https://huggingface.co/datasets/joehjhuang/TactileTracking
Unpack it. The recordings have no mesh: export the object's in the gel frame of the first image. Then
  midastouch build-codebook aligned.ply --sensor gelsight_mini
  midastouch evaluate avocado0 --mesh aligned.ply --background free.png
avocado0 is the folder of a trial, free.png a no-contact image of its sensor."""


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
        print(_TACTILE_TRACKING)
        return 0
    if not args.names:
        raise InputError(f"download {args.what}: name what to download; see midastouch download --help")
    from ..download.ycb import FOLDERS, SERVER, download_mesh, download_part

    if args.what == "ycb-mesh":
        for name in args.names:
            print(download_mesh(name, args.out or Path("out/ycb"), args.mirror or SERVER))
        return 0
    if unknown := set(args.names) - FOLDERS.keys():
        raise InputError(f"ycb-slide {', '.join(sorted(unknown))}: no such part; there are {', '.join(FOLDERS)}")
    for part in args.names:
        for folder in download_part(part, args.out or Path("out/ycb_slide")):
            print(folder)
    return 0
