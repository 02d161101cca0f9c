"""`midastouch identify`: how often, how soon and how surely an object of a catalogue is identified."""

from __future__ import annotations

import argparse

from midastouch_tools.commands import arguments

from . import options


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
        "`midastouch benchmark`: the same command goes on where it was stopped.",
    )
    parser.add_argument("--slides", type=arguments.positive_int, default=5, help="per object (default 5)")
    parser.add_argument("--length", type=arguments.positive, default=0.3, help="of a slide, m (default 0.3)")
    parser.add_argument(
        "--codebook-size", type=arguments.positive_int, default=50_000, help="poses of an object (default 50000)"
    )
    options.add_campaign_options(parser, "slide")


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    from ..statistics.exploring import summarise_identification
    from ..trials.cache import SlideKind
    from ..trials.identification import IdentityPlan
    from ..trials.object_sets import chosen_meshes
    from ..trials.setup import load_filter_config

    cache = options.cache_of(args, slides=SlideKind(args.length), codebook_size=args.codebook_size)
    plan = IdentityPlan(cache, load_filter_config(args.config, args.preset), tuple(range(args.slides)))
    trials, result = options.run_campaign(args, plan, "slide")
    result["config"] |= {"jobs": args.jobs, "cluster": args.cluster}
    catalogue = [mesh.name for mesh in chosen_meshes(args.meshes, args.objects, args.out)]
    summary = summarise_identification(trials) if trials else None
    result |= {"catalogue": catalogue, "identification": summary, "trials": trials}
    return options.conclude(args, "identify", result)
