"""`midastouch bench-scale`: time and memory of the filter over hypotheses and codebook poses."""

from __future__ import annotations

import argparse

from midastouch_tools.commands import arguments

from . import options
from .bench import TimedSlide


def add_parser(subparsers) -> None:
    """Add the sub-command."""
    parser = arguments.add_command(
        subparsers,
        "bench-scale",
        run,
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
        parser.add_argument(option, nargs="+", type=arguments.positive_int, metavar="N", help=what)
    parser.add_argument("--frames", type=arguments.positive_int, default=60, help="of the slide (default 60)")
    options.add_network_options(parser)
    options.add_json_option(parser)


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    from midastouch_common.output_paths import cached_codebook_path
    from midastouch_tools.codebooks import cached_codebook
    from midastouch_tools.progress import progress_bar

    from ..speed.scaling import PARTICLES, POSES, FilterInput, measure, sizes
    from ..trials.cache import Touches

    timed = TimedSlide.of(args)
    mesh, networks, sequence = timed.mesh, timed.networks, timed.sequence
    measurements = Touches.perceive(sequence, networks).measurements
    slide = FilterInput(measurements, sequence.poses_measured)
    points = []
    for particles, poses in progress_bar(
        iterable=list(sizes(args.particles or PARTICLES, args.poses or POSES)), unit="filter"
    ):
        cached_codebook(mesh, networks.tcn, networks.sensor, poses)
        measured = measure(mesh.path, cached_codebook_path(mesh.name, poses), slide, particles)
        points.append({"particles": particles, "poses": poses} | measured)
    return options.conclude(args, "bench-scale", timed.result(frames=args.frames, scaling=points))
