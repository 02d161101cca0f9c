"""Shared code of the commands: parser set-up, shared options, value checks, loading of a mesh."""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from midastouch_common.errors import InputError
from midastouch_common.files import require_place
from midastouch_common.names import require_name

from . import limits

if TYPE_CHECKING:
    from midastouch_common.mesh import ObjectMesh

    from ..bags.images import GelStream


Checked = TypeVar("Checked")


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
    """Add --image-topic, --base-frame, --gel-frame and --rotation, the options of `gel_stream`."""
    add_name(parser, "--image-topic", "topic", "images of the bag", "/image_raw")
    add_frame_options(parser)
    add_rotation(parser)


def add_frame_options(parser: argparse.ArgumentParser) -> None:
    """Add --base-frame and --gel-frame."""
    add_name(parser, "--base-frame", "frame", "frame of the sensor's poses in the bag", "base_link")
    add_name(parser, "--gel-frame", "frame", "the sensor's, in the bag", "digit_gel_frame")


def add_name(parser: argparse.ArgumentParser, option: str, kind: str, what: str, default: str = "") -> None:
    """Add an option that takes a name of this kind, as `require_name` knows them, or nothing; what: for its help."""
    parser.add_argument(
        option,
        type=lambda text: text and _checked(require_name, kind, text, "the name"),
        default=default,
        metavar=kind.split()[0].upper(),
        help=f"{what} (default: {default or 'none'})",
    )


def add_rotation(parser: argparse.ArgumentParser) -> None:
    """Add --rotation."""
    parser.add_argument(
        "--rotation",
        type=int,
        choices=(0, 90, 180, 270),
        default=0,
        help="degrees counter-clockwise by which images are turned; 90 for those in the camera's own landscape order",
    )


def gel_stream(args: argparse.Namespace) -> GelStream:
    """Return the stream that the options of `add_bag_options` name."""
    from ..bags.images import GelStream

    return GelStream(args.image_topic, args.base_frame, args.gel_frame, args.rotation)


def add_jobs_option(parser: argparse.ArgumentParser) -> None:
    """Add --jobs."""
    parser.add_argument(
        "--jobs",
        type=limits.jobs,
        default=len(os.sched_getaffinity(0)),
        metavar="N",
        help="at a time on this machine (default: one per core)",
    )


_METAVARS = {"file": "FILE", "folder": "DIR", "file or folder": "PATH"}


def add_place(
    parser: argparse.ArgumentParser, option: str, kind: str, what: str, default: str | None = None, **options
) -> None:
    """Add an option for a place that is written: a `file`, a `folder`, or a `file or folder`.

    what: for its help, which names the default; options: of `add_argument`.
    """
    options = {"metavar": _METAVARS[kind], "help": f"{what} (default {default})" if default else what, **options}
    parser.add_argument(option, type=lambda text: _checked(require_place, text, kind), default=default, **options)


def _checked(check: Callable[..., Checked], *arguments: str) -> Checked:
    try:
        return check(*arguments)
    except InputError as error:
        raise argparse.ArgumentTypeError(str(error)) from error


def ros_arguments(node: str, parameters: Mapping[str, object], namespace: str = "") -> list[str]:
    """Return the command line of a node's executable that sets its parameters and its namespace."""
    # ROS reads values as YAML, and JSON is YAML: quotes keep a path text; YAML has no surrogates, so no ASCII escapes
    written = {name: json.dumps(value, ensure_ascii=False) for name, value in parameters.items()}
    words = [word for name, value in written.items() for word in ("-p", f"{name}:={value}")]
    if namespace:
        words += ["-r", f"__ns:=/{namespace.strip('/')}"]
    return [node, "--ros-args", *words]


def load_mesh(name_or_path: str) -> ObjectMesh:
    """Return the mesh at a path, or that of the bundled object of this name."""
    from midastouch_common.mesh import ObjectMesh
    from midastouch_perception.objects import bundled_objects

    bundled = bundled_objects()
    if not Path(name_or_path).is_file() and name_or_path in bundled:
        return ObjectMesh.load(bundled[name_or_path])
    if not Path(name_or_path).exists() and not Path(name_or_path).suffix:
        raise InputError(f"{name_or_path}: no such mesh file, nor a bundled object ({', '.join(sorted(bundled))})")
    return ObjectMesh.load(name_or_path)
