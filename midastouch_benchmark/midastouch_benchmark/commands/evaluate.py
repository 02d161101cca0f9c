"""`midastouch evaluate`: the whole pipeline over sequences, frame by frame, with errors and times."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from midastouch_tools.commands import arguments, limits

from . import options

if TYPE_CHECKING:
    from midastouch_filter.core.config import FilterConfig
    from midastouch_tools.datasets import Sequence

    from ..trials.sequence_trials import TrialPlan
    from ..trials.setup import Networks, Untouched


def add_parser(subparsers) -> None:
    """Add the sub-command."""
    parser = arguments.add_command(
        subparsers,
        "evaluate",
        run,
        "run the whole pipeline over sequences and measure errors and times",
        "midastouch simulate handle_tool --seed 3 --out out/slide\n"
        "  midastouch build-codebook handle_tool\n"
        "  midastouch evaluate out/slide --init uniform",
        "Every frame is processed, in order, without ROS. Mesh and codebook are found by the object's name\n"
        "after `midastouch build-codebook`, or given. A sequence always gives the same answer; for more trials\n"
        "simulate more of them, with other seeds.",
    )
    parser.add_argument(
        "sequences", nargs="+", metavar="SEQ", help="YCB-Slide sequence folders, or trials of TactileTracking"
    )
    parser.add_argument(
        "--real",
        action="store_true",
        help="as the paper on real slides of YCB-Slide: beta 0.5; its figures beside ours",
    )
    parser.add_argument("--mesh", help="mesh of the object (default: the one the codebook was built from)")
    parser.add_argument("--codebook", metavar="FILE", help="default: out/codebooks/<mesh or object>.npz")
    parser.add_argument(
        "--objects",
        nargs="+",
        metavar="FILE",
        help="in place of mesh and codebook: codebooks, or folders of codebooks, of which one is to be found out",
    )
    options.add_filter_options(parser)
    parser.add_argument(
        "--init",
        choices=("paper", "uniform"),
        default="paper",
        help="paper: about the truth, sigma = beta (diagonal/3, 60 deg); uniform: anywhere (default paper)",
    )
    parser.add_argument("--stride", type=limits.count, default=1, help="use every n-th frame (default 1)")
    parser.add_argument("--max-frames", type=limits.count, help="stop after this many frames")
    options.add_network_options(parser, sensor="")
    options.add_sequence_options(parser)
    options.add_json_option(parser)


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    import dataclasses
    import sys

    from midastouch_common.errors import InputError
    from midastouch_tools.datasets import load_sequence
    from midastouch_tools.machine import machine_info
    from midastouch_tools.progress import progress_bar

    from ..statistics.accuracy import summarise_trials
    from ..trials.sequence_trials import PAPER_REAL, PAPER_REAL_BETA, TrialPlan, mesh_doubt, require_real, run_sequence
    from ..trials.setup import Networks, load_filter_config, require_same_gel, sensor_of, untouched_of

    if args.objects and (args.mesh or args.codebook):
        raise InputError("--objects: stands in place of --mesh and --codebook; leave these out")
    config = load_filter_config(args.config, args.preset)
    plan = TrialPlan(args.init, PAPER_REAL_BETA if args.real else 1.0, args.stride, args.max_frames)
    # all input is read before the first trial: a bad third sequence shall not cost the time of the first two
    sequences = [load_sequence(path) for path in args.sequences]
    if args.real:
        require_real(sequences)
        if args.init == "uniform":
            raise InputError("--real: the paper's starts are about the truth; leave out --init uniform")
    sensor = args.sensor or sensor_of(sequences)
    networks = Networks.load(args.tdn, args.tcn, sensor, calibration=args.calibration)
    untouched = [untouched_of(sequence, args.background) for sequence in sequences]
    require_same_gel(networks.tdn, untouched)
    doubts = [each.doubt for each in untouched]
    work = []
    for sequence, free in () if args.objects else zip(sequences, untouched, strict=True):
        mesh, codebook = options.load_object(sequence.object_name, args.mesh, args.codebook, networks, sensor, args.tcn)
        doubts.append(mesh_doubt(sequence, plan.frame_indices(sequence), mesh))
        work.append((sequence, mesh, codebook, free))
    doubts = [doubt for doubt in doubts if doubt]
    for doubt in doubts:
        print(f"warning: {doubt}", file=sys.stderr)
    if args.objects:
        return _identify(args, sequences, untouched, networks, config, plan)
    result: dict[str, Any] = {
        "config": {**dataclasses.asdict(plan), "filter": dataclasses.asdict(config), "networks": networks.describe()},
        "machine": machine_info(),
        "warnings": doubts,
        "sequences": [],
        "trials": [],
    }
    total = sum(len(plan.frame_indices(sequence)) for sequence, *_ in work)
    with progress_bar(total=total, unit="frame") as bar:
        for sequence, mesh, codebook, free in work:
            bar.set_description(sequence.name)
            description, trial = run_sequence(sequence, mesh, codebook, networks, config, plan, free, bar.update)
            result["sequences"].append(description)
            result["trials"].append(trial)
    result["summary"] = summarise_trials(result["trials"])
    if args.real:
        result["paper_real"] = PAPER_REAL
    return options.conclude(args, "evaluate", result)


def _identify(
    args: argparse.Namespace,
    sequences: list[Sequence],
    untouched: list[Untouched],
    networks: Networks,
    config: FilterConfig,
    plan: TrialPlan,
) -> int:
    """Identify the object of each sequence, and return the exit status."""
    from pathlib import Path

    from midastouch_common.errors import InputError
    from midastouch_filter.identification.catalogue import read_catalogue

    from ..trials.identification import identify, right_answer
    from ..trials.sequence_trials import perceived

    sensor = args.sensor or networks.sensor.name

    def build(path: Path):
        if not path.exists():
            raise InputError(f"{path}: no such codebook or folder of codebooks; check the path")
        command = options.how_to_build(str(path), sensor, args.tcn)
        raise InputError(f"{path}: not a codebook; build it: {command}")

    catalogue = read_catalogue([Path(each) for each in args.objects], build, config, sensor)
    trials = []
    for sequence, free in zip(sequences, untouched, strict=True):
        indices = plan.frame_indices(sequence)
        images = [sequence.image(i) for i in indices]
        frames = perceived(sequence, indices, images, free.image, networks)
        truth = right_answer(catalogue, sequence.object_name)
        trials.append({"sequence": sequence.name, "truth": truth} | identify(catalogue, frames, truth, config))
    names = [entry.name for entry in catalogue.entries]
    return options.conclude(args, "evaluate --objects", {"catalogue": names, "identified": trials})
