"""`midastouch import-weights`: networks trained by the paper's authors, as files for --tdn and --tcn."""

from __future__ import annotations

import argparse

from . import arguments, limits


def add_parser(subparsers) -> None:
    """Add the sub-command."""
    parser = arguments.add_command(
        subparsers,
        "import-weights",
        run,
        "turn weights of the official depth or code network into a file for --tdn or --tcn",
        "midastouch import-weights tcn_weights.pth.tar --out out/weights",
        "FILE is a PyTorch checkpoint, .safetensors or .npz of the official FCRN or MinkLoc3D; which of them, its\n"
        "tensors tell. Nothing but tensors is read from it; a checkpoint needs PyTorch for that (the train extra).\n"
        "The network and its model card are written to --out.",
    )
    parser.add_argument("file", metavar="FILE", help="checkpoint, such as tdn_weights.pth.tar or tcn_weights.pth.tar")
    arguments.add_place(parser, "--out", "folder", "folder", "out/weights")
    parser.add_argument(
        "--voxel-size",
        type=limits.voxel_size,
        default=0.001,
        help="of MinkLoc3D, of the contact scaled to [-1, 1] (default 0.001, the official one)",
    )


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    from midastouch_perception.official_weights import import_weights

    path = import_weights(args.file, args.out, args.voxel_size)
    option = path.name.partition("_")[0]
    print(f"{path}: {path.stat().st_size / 2**20:.1f} MiB; use it with --{option} {path}")
    return 0
