"""`midastouch identify`: which object of a catalogue is it? How often, how soon and how surely that is answered."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from midastouch_bringup.commands import arguments

from . import options

if TYPE_CHECKING:
    from ..trials.cache import Cache
    from ..trials.identification import IdentityPlan
    from ..trials.shape_catalogues import ShapePlan


def add_parser(subparsers) -> None:
    """Add the sub-command."""
    parser = arguments.add_command(
        subparsers,
        "identify",
        run,
        "measure how well the objects of a catalogue are told apart, and others refused",
        "midastouch identify --meshes ../shared/meshes/ycb --slides 10 --json out/identify.json",
        "Each trial slides 0.3 m over one object, of which nothing is known at the start: once with the object in the\n"
        "catalogue, and once left out of it. Slides, codebooks and finished trials are kept in --out, as by\n"
        "`midastouch benchmark`: the same command goes on where it was stopped.\n\n"
        "--shapes asks how catalogues of ever more objects fare: of so many random shapes each, the first hundred of\n"
        "which are slid over. Only the object is asked for, and whether it was among those that were compared.",
    )
    parser.add_argument("--slides", type=arguments.positive_int, default=5, help="per object (default 5)")
    parser.add_argument("--length", type=arguments.positive, default=0.3, help="of a slide, m (default 0.3)")
    parser.add_argument(
        "--codebook-size", type=arguments.positive_int, default=50_000, help="poses of an object (default 50000)"
    )
    parser.add_argument(
        "--shapes",
        nargs="+",
        type=arguments.positive_int,
        metavar="N",
        help="random shapes in each catalogue, instead of --meshes",
    )
    parser.add_argument(
        "--room",
        type=arguments.positive_int,
        help="with --shapes: poses that a touch is compared with (default 1048576)",
    )
    options.add_campaign_options(parser, "slide")


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""

    from midastouch_bringup.machine import machine_info

    from ..tables.results import of_identification, shown
    from ..trials.cache import Cache, SlideKind

    folder = options.campaign_folder(args)
    cache = Cache(folder, args.tdn, args.tcn, args.sensor, SlideKind(args.length), args.codebook_size)
    machine = machine_info()
    plan, found, missing, notes = (_of_shapes if args.shapes else _of_meshes)(args, cache)
    config = plan.describe() | {"jobs": args.jobs, "cluster": args.cluster}
    result = {"config": config, "machine": machine, "missing_slides": missing} | found
    return options.conclude(args, result, shown(of_identification(result)), *notes, *options.left(missing, "slide"))


def _of_meshes(args: argparse.Namespace, cache: Cache) -> tuple[IdentityPlan, dict, int, list[str]]:
    """What was planned; what was found, for the result; slides that are missing; notes."""

    from ..statistics.exploring import summarise_identification
    from ..trials.identification import IdentityPlan, run_identification
    from ..trials.setup import load_filter_config
    from ..trials.trial_log import TrialLog

    plan = IdentityPlan(cache, load_filter_config(args.config, args.preset), tuple(range(args.slides)))
    meshes = options.chosen_meshes(args.meshes, args.objects, args.out)
    with options.campaign(args, "slide") as workforce:
        trials, missing = run_identification(plan, meshes, TrialLog(cache.folder / "identifications.jsonl"), workforce)
    summary = summarise_identification(trials) if trials else None
    wrong = [f"{answer}: {times}" for answer, times in summary["answers"].items()] if summary else []
    found = {"catalogue": [mesh.name for mesh in meshes], "identification": summary, "trials": trials}
    return plan, found, missing, wrong


def _of_shapes(args: argparse.Namespace, cache: Cache) -> tuple[ShapePlan, dict, int, list[str]]:
    """Likewise."""
    from midastouch_common.errors import InputError
    from midastouch_filter.identification.catalogue import ROOM

    from ..statistics.exploring import summarise_shapes
    from ..trials.setup import load_filter_config
    from ..trials.shape_catalogues import ShapePlan, run_shapes
    from ..trials.trial_log import TrialLog

    if args.meshes or args.objects:
        raise InputError("--shapes makes its own objects; leave --meshes and --objects out")
    slides, sizes = tuple(range(args.slides)), tuple(sorted(set(args.shapes)))
    plan = ShapePlan(cache, load_filter_config(args.config, args.preset), slides, room=args.room or ROOM, sizes=sizes)
    with options.campaign(args, "slide") as workforce:
        trials, missing = run_shapes(plan, TrialLog(cache.folder / "shape_catalogues.jsonl"), workforce)
    summary = summarise_shapes(trials)
    return plan, {"shape_catalogues": summary, "trials": trials}, missing, []
