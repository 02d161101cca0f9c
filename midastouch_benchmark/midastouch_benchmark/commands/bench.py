"""`midastouch bench` and `bench-scale`: milliseconds per stage, Hz end to end, memory; and how they grow."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from midastouch_common.errors import InputError
from midastouch_tools.commands import arguments, limits

from . import options

if TYPE_CHECKING:
    from midastouch_common.mesh import ObjectMesh
    from midastouch_tools.datasets import Sequence

    from ..trials.setup import Networks

_SEED = 1
"""Of the slide. On it the bundled tool stays unknown if it is at the start, and known if it is: both are timed."""


def add_parser(subparsers) -> None:
    """Add the sub-commands."""
    _add_scale(subparsers)
    parser = arguments.add_command(
        subparsers,
        "bench",
        run,
        "measure the speed of every stage and of the whole pipeline on this machine",
        "midastouch bench --json out/bench.json",
        "On a bundled object, whose codebook is built first and kept in out/. CPU time per call is given\n"
        "beside wall time: it is the figure that holds on a busy machine.",
    )
    parser.add_argument("--object", default="handle_tool", help="bundled object (default handle_tool)")
    parser.add_argument("--codebook-size", type=limits.poses, default=50_000, help="default 50000")
    parser.add_argument("--frames", type=limits.count, default=150, help="of the slide (default 150)")
    options.add_network_options(parser)
    parser.add_argument(
        "--paper-networks",
        action="store_true",
        help="also time the paper's networks, FCRN and MinkLoc3D (with random weights: speed does not depend on them)",
    )
    options.add_json_option(parser)


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    from midastouch_common.output_paths import cached_codebook_path
    from midastouch_tools.codebooks import cached_codebook
    from midastouch_tools.progress import progress_bar

    from ..ros.pose_age import pose_age
    from ..speed.stages import SpeedMeasurement
    from ..speed.start import node_start
    from ..speed.timing import peak_rss_mb

    mesh, networks, sequence, result = _timed_slide(args)
    codebook = cached_codebook(mesh, networks.tcn, networks.sensor, args.codebook_size)
    speed = SpeedMeasurement(mesh, codebook, sequence, networks)
    result["codebook_size"] = len(codebook.poses)
    measured = (
        speed.networks,
        speed.localisation,
        speed.alignment,
        speed.lookup,
        lambda: pose_age(speed.stepper()),
        lambda: node_start(mesh.path, cached_codebook_path(mesh.name, args.codebook_size)),
        speed.simulator,
    )
    for stage in progress_bar(iterable=measured, unit="stage"):
        result |= stage()
    result["peak_rss_mb"] = peak_rss_mb()
    if args.paper_networks:  # last: they need more memory than all the others
        result |= speed.paper_networks()
    return options.conclude(args, "bench", result)


_FEWEST = 10  # frames, of which the first ones are dropped


def _timed_slide(args: argparse.Namespace) -> tuple[ObjectMesh, Networks, Sequence, dict]:
    """Return a bundled object, networks, a simulated slide of --frames over the object, and the first entries of the
    result; InputError for too few frames, or missing files."""
    from midastouch_simulation.slide import STEP
    from midastouch_tools.datasets import load_sequence
    from midastouch_tools.datasets.slide_simulation import cached_slide
    from midastouch_tools.machine import machine_info

    from ..trials.setup import Networks

    if args.frames < _FEWEST:
        raise InputError(f"--frames {args.frames}: too few to time; give at least {_FEWEST}")
    networks, machine = Networks.load(args.tdn, args.tcn, args.sensor), machine_info()
    mesh = arguments.load_mesh(args.object)
    sequence = load_sequence(cached_slide(mesh, networks.sensor, STEP * args.frames, _SEED))
    result = {"threads": machine["cores"], "machine": machine, "object": mesh.name, "networks": networks.describe()}
    return mesh, networks, sequence, result | {"frames": args.frames}


def _add_scale(subparsers) -> None:
    parser = arguments.add_command(
        subparsers,
        "bench-scale",
        _scale,
        "measure how time and memory of the filter grow with hypotheses and codebook poses",
        "midastouch bench-scale --json out/scale.json",
        "On a bundled object, whose codebooks are built first and kept in out/: some 500 s for a million poses on two\n"
        "cores. Each filter runs in a process of its own and starts with nothing known. Errors are not measured: see\n"
        "`midastouch benchmark --variant front`.",
    )
    parser.add_argument("--object", default="handle_tool", help="bundled object (default handle_tool)")
    for option, what in (
        ("--particles", "poses that are hypotheses at the start, of a codebook of 50,000 (default 100 to 50,000)"),
        ("--poses", "of the codebook, 50,000 of them hypotheses at the start (default 1,000 to a million)"),
    ):
        parser.add_argument(option, nargs="+", type=limits.poses, metavar="N", help=what)
    parser.add_argument("--frames", type=limits.count, default=60, help="of the slide (default 60)")
    options.add_network_options(parser)
    options.add_json_option(parser)


def _scale(args: argparse.Namespace) -> int:
    from midastouch_common import se3
    from midastouch_common.output_paths import cached_codebook_path
    from midastouch_tools.codebooks import cached_codebook
    from midastouch_tools.progress import progress_bar

    from ..speed.scaling import PARTICLES, POSES, measure, sizes
    from ..trials.cache import Touches

    mesh, networks, sequence, result = _timed_slide(args)
    measurements = Touches.perceive(sequence, networks).measurements
    steps = list(zip(se3.odometry(sequence.poses_measured), measurements, strict=True))
    points = []
    for particles, poses in progress_bar(
        iterable=list(sizes(args.particles or PARTICLES, args.poses or POSES)), unit="filter"
    ):
        cached_codebook(mesh, networks.tcn, networks.sensor, poses)
        measured = measure(mesh.path, cached_codebook_path(mesh.name, poses), steps, particles)
        points.append({"particles": particles, "poses": poses} | measured)
    return options.conclude(args, "bench-scale", result | {"scaling": points})
