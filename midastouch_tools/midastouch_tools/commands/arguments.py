"""Shared code of the commands: parser set-up, shared options, value checks, loading of a mesh."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from midastouch_common.errors import InputError
from midastouch_common.files import require_place

if TYPE_CHECKING:
    from midastouch_common.mesh import ObjectMesh

    from ..bags.images import GelStream


def add_command(subparsers, name: str, run: Callable, summary: str, example: str, details: str):
    """Add a sub-command with its one-line summary, longer text and example; returns its parser."""
    parser = subparsers.add_parser(
        name,
        help=summary,
        description=f"{summary[0].upper()}{summary[1:]}.\n\n{details}".rstrip(),
        epilog=f"example:\n  {example}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.set_defaults(run=run)
    return parser


def add_bag_options(parser: argparse.ArgumentParser) -> None:
    """Add --image-topic, --base-frame and --gel-frame, the options of `gel_stream`."""
    for option, default, metavar, what in (
        ("--image-topic", "/image_raw", "TOPIC", "images of the bag"),
        ("--base-frame", "base_link", "FRAME", "frame of the sensor's poses in the bag"),
        ("--gel-frame", "digit_gel_frame", "FRAME", "the sensor's, in the bag"),
    ):
        parser.add_argument(option, default=default, metavar=metavar, help=f"{what} (default {default})")


def gel_stream(args: argparse.Namespace) -> GelStream:
    """Return the stream that the options of `add_bag_options` name."""
    from ..bags.images import GelStream

    return GelStream(args.image_topic, args.base_frame, args.gel_frame)


def add_cluster_options(parser: argparse.ArgumentParser) -> None:
    """Add --jobs and --cluster."""
    parser.add_argument(
        "--jobs",
        type=positive_int,
        default=len(os.sched_getaffinity(0)),
        metavar="N",
        help="at a time on this machine (default: one per core)",
    )
    parser.add_argument("--cluster", metavar="ADDRESS", help="of a Dask scheduler, such as tcp://10.0.0.1:8786")


def positive_int(text: str) -> int:
    """argparse type: a whole number of at least 1."""
    return int(_checked(text, int, lambda value: value >= 1, "a whole number of at least 1"))


def port(text: str) -> int:
    """argparse type: a TCP port that needs no privileges."""
    return int(_checked(text, int, lambda value: 1024 <= value <= 65535, "a port in 1024...65535"))


def seed(text: str) -> int:
    """argparse type: a whole number of at least 0."""
    return int(_checked(text, int, lambda value: value >= 0, "a whole number of at least 0"))


def positive(text: str) -> float:
    """argparse type: a finite number above 0."""
    return _checked(text, float, lambda value: 0 < value < float("inf"), "a number above 0")


def writable_file(text: str) -> Path:
    """argparse type: a file that can be written; its folders need not be there."""
    try:
        return require_place(text)
    except InputError as error:
        raise argparse.ArgumentTypeError(str(error)) from error


def _checked(text: str, kind: type, holds: Callable, wanted: str):
    try:
        value = kind(text)
    except ValueError:
        value = None
    if value is None or not holds(value):
        raise argparse.ArgumentTypeError(f"{text!r} is not {wanted}")
    return value


def load_mesh(name_or_path: str) -> ObjectMesh:
    """Return the mesh at a path, or that of the bundled object of this name."""
    from midastouch_common.mesh import ObjectMesh
    from midastouch_perception.objects import bundled_objects

    bundled = bundled_objects()
    if not Path(name_or_path).is_file() and name_or_path in bundled:
        return ObjectMesh.load(bundled[name_or_path])
    if not Path(name_or_path).is_file() and not Path(name_or_path).suffix:
        raise InputError(f"{name_or_path}: no such mesh file, nor a bundled object ({', '.join(sorted(bundled))})")
    return ObjectMesh.load(name_or_path)
