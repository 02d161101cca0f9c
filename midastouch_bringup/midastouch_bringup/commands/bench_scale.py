"""`midastouch bench-scale`: time and memory of the filter over particles and codebook poses."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from . import arguments, outcome

if TYPE_CHECKING:
    from midastouch_perception.mesh import ObjectMesh

    from ..evaluation.setup import Networks
    from ..evaluation.speed.scaling import Slide


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
    arguments.add_network_options(parser)
    outcome.add_json_option(parser)


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    from midastouch_perception.errors import InputError

    from ..codebooks import cached_codebook, cached_codebook_path
    from ..evaluation.machine import machine_info
    from ..evaluation.setup import Networks
    from ..evaluation.speed.scaling import PARTICLES, POSES, measure, scaling_table, sizes
    from ..evaluation.table import text_table
    from ..progress import progress_bar

    if args.frames < 10:
        raise InputError(f"--frames {args.frames}: too few to time; give at least 10")
    networks = Networks.load(args.tdn, args.tcn, args.sensor)
    mesh = arguments.load_mesh(args.object)
    slide = _slide(mesh, networks, args.frames)
    points = []
    for particles, poses in progress_bar(
        iterable=list(sizes(args.particles or PARTICLES, args.poses or POSES)), unit="filter"
    ):
        cached_codebook(mesh, networks.tcn, networks.sensor, poses)
        measured = measure(mesh.path, cached_codebook_path(mesh, poses), slide, particles)
        points.append({"particles": particles, "poses": poses} | measured)
    machine = machine_info()
    result = {
        "threads": machine["cores"],
        "machine": machine,
        "object": mesh.name,
        "networks": networks.describe(),
        "frames": args.frames,
        "scaling": points,
    }
    return outcome.conclude(args, result, text_table(*scaling_table(points), left=0))


def _slide(mesh: ObjectMesh, networks: Networks, frames: int) -> Slide:
    """The beginning of a slide over the object, as the networks feel it."""
    from ..datasets import load_sequence
    from ..datasets.slide_simulation import cached_slide
    from ..evaluation.speed.scaling import Slide
    from ..evaluation.touches import Touches

    sequence = load_sequence(cached_slide(mesh, networks.sensor, 1.5e-3 * frames))
    felt = Touches.perceive(sequence, networks).felt[:frames]
    return Slide(felt, sequence.poses_measured[: len(felt)], sequence.poses_true[0])
