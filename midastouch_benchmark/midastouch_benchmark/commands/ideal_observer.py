"""`midastouch ideal-observer`: the filter against the same filter without a budget."""

from __future__ import annotations

import argparse

from midastouch_tools.commands import arguments

from . import options


def add_parser(subparsers) -> None:
    """Add the sub-command."""
    parser = arguments.add_command(
        subparsers,
        "ideal-observer",
        run,
        "measure how far the filter is from what could be known: from comparing every pose with all touches",
        "midastouch ideal-observer --objects cad --slides 1 --codebook-size 10000 --json out/observer.json",
        "The observer is the filter without a budget: it compares every pose of the codebook with the same touches,\n"
        "by penetration maps or by codes. The slides of a protocol show from which path on either knows where it is,\n"
        "how soon after a kidnap, and how often neither can.\n"
        "--protocol: uniform (nothing known at the start), plain (paper's start), lift or kidnap (on the way).\n"
        "Slides, codebooks and finished trials are kept in --out: the same command continues where it was stopped.",
    )
    parser.add_argument("--protocol", default="uniform", metavar="NAME", help="see above (default uniform)")
    parser.add_argument(
        "--evidence", nargs="+", choices=("maps", "codes"), help="what the observer compares (default: each)"
    )
    parser.add_argument("--slides", type=arguments.positive_int, default=5, help="per object (default 5)")
    parser.add_argument("--length", type=arguments.positive, help="of a slide, m (default: the protocol's)")
    parser.add_argument("--codebook-size", type=arguments.positive_int, default=10_000, help="poses (default 10000)")
    options.add_campaign_options(parser, "slide")


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    from ..statistics.exploring import summarise_observing
    from ..trials.observed_slides import EVIDENCE, ObservedPlan, chosen_observed
    from ..trials.protocols import PROTOCOLS

    protocol = chosen_observed(args.protocol)
    slides = PROTOCOLS[protocol].slides.of_length(args.length)
    cache = options.cache_of(args, slides=slides, codebook_size=args.codebook_size)
    config, evidence = options.single_threaded(args), tuple(dict.fromkeys(args.evidence or EVIDENCE))
    plan = ObservedPlan(cache, config, evidence, tuple(range(args.slides)), protocol)
    trials, result = options.run_campaign(args, plan, "slide")
    result["config"] |= {"jobs": args.jobs, "cluster": args.cluster}
    summary = summarise_observing(trials, evidence, config.keyframe_spacing)
    return options.conclude(args, "ideal-observer", result | {"ideal_observer": summary, "trials": trials})
