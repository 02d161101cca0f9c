"""`midastouch export`: recordings in the formats of learning stacks."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from midastouch_common.missing_modules import install_extra

from . import arguments

if TYPE_CHECKING:
    from ..export.recording import Recording


def add_parser(subparsers) -> None:
    """Add the sub-command."""
    parser = arguments.add_command(
        subparsers,
        "export",
        run,
        "write recordings as a LeRobot dataset or as HDF5",
        "midastouch export out/demo/run.mcap --format lerobot --out out/dataset",
        "One episode for each bag: images, poses, and what the bag has of penetration maps, estimates, states and\n"
        f"truth. What is in the files: docs/exports.md. Needs: {install_extra('export')}.",
    )
    parser.add_argument("bags", nargs="+", metavar="RUN_OR_BAG", help="bag of a run or of a sensor: .mcap, or folder")
    parser.add_argument("--format", required=True, choices=("lerobot", "hdf5"), help="what to write")
    arguments.add_place(parser, "--out", "folder", "folder to write", required=True)
    arguments.add_bag_options(parser)


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    from midastouch_common.files import atomic_path, require_new_folder

    from ..export.recording import Recording
    from ..text_table import counted

    write, out = _writer(args.format), require_new_folder(args.out)  # before a long bag is read
    recordings = [Recording(path, arguments.gel_stream(args)) for path in args.bags]
    print(f"reading and writing {counted(len(recordings), 'recording')}, some ten seconds each", flush=True)
    with atomic_path(out) as folder:
        folder.mkdir()
        frames = write(recordings, folder)
    names = ", ".join(column.name for column in recordings[0].columns)
    print(f"{args.out}: {counted(frames, 'frame')} in {counted(len(recordings), 'episode')}: {names}")
    return 0


def _writer(name: str) -> Callable[[Sequence[Recording], Path], int]:
    """Return the function that writes that format into a folder; InputError with the fix if its library is missing."""
    from midastouch_common.errors import InputError

    try:
        if name == "lerobot":
            from ..export.lerobot import write_lerobot as write
        else:
            from ..export.hdf5 import write_hdf5 as write
    except ModuleNotFoundError as error:
        raise InputError(f"--format {name} needs {error.name}: {install_extra('export')}") from error
    return write
