"""`midastouch bench-scale`: time and memory of the filter over particles and codebook poses."""

from __future__ import annotations

import argparse

from midastouch_bringup.commands import arguments

from . import options
from .bench import TimedSlide


def add_parser(subparsers) -> None:
    """Add the sub-command."""
    parser = arguments.add_command(
        subparsers,
        "bench-scale",
        run,
        "measure how time and memory of the filter grow with particles and codebook poses",
        "midastouch bench-scale --json out/scale.json",
        "On a bundled object, whose codebooks are built first and kept in out/: some 500 s for a million poses on two\n"
        "cores. Each filter runs in a process of its own, its number of particles kept. Nothing is said of errors:\n"
        "those are set against time by `midastouch benchmark --variant front`.",
    )
    parser.add_argument("--object", default="handle_tool", help="bundled object (default handle_tool)")
    for option, what in (
        ("--particles", "with 50,000 poses (default 100 to a million)"),
        ("--poses", "with 50,000 particles (default 1,000 to a million)"),
    ):
        parser.add_argument(option, nargs="+", type=arguments.positive_int, metavar="N", help=what)
    parser.add_argument("--frames", type=arguments.positive_int, default=60, help="of the slide (default 60)")
    options.add_network_options(parser)
    options.add_json_option(parser)


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    from midastouch_bringup.codebooks import cached_codebook
    from midastouch_bringup.output_paths import cached_codebook_path
    from midastouch_bringup.progress import progress_bar

    from ..speed.scaling import PARTICLES, POSES, Slide, measure, sizes
    from ..tables.speed import scaling_table
    from ..tables.table import terminal
    from ..trials.cache import Touches

    timed = TimedSlide.of(args)
    mesh, networks, sequence = timed.mesh, timed.networks, timed.sequence
    measurements = Touches.perceive(sequence, networks).measurements
    slide = Slide(measurements, sequence.poses_measured, sequence.poses_true[0])
    points = []
    for particles, poses in progress_bar(
        iterable=list(sizes(args.particles or PARTICLES, args.poses or POSES)), unit="filter"
    ):
        cached_codebook(mesh, networks.tcn, networks.sensor, poses)
        measured = measure(mesh.path, cached_codebook_path(mesh.name, poses), slide, particles)
        points.append({"particles": particles, "poses": poses} | measured)
    result = timed.result(frames=args.frames, scaling=points)
    return options.conclude(args, result, terminal(scaling_table(points)))
