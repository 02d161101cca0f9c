"""`midastouch evaluate-exploration`: path of a finger until its pose is known, by suggestions and at random."""

from __future__ import annotations

import argparse

from midastouch_tools.commands import arguments

from . import options


def add_parser(subparsers) -> None:
    """Add the sub-command."""
    parser = arguments.add_command(
        subparsers,
        "evaluate-exploration",
        run,
        "measure how far a finger slides until the filter has converged, where it is told to and at random",
        "midastouch evaluate-exploration --meshes ../shared/meshes/ycb --trials 10 --json out/exploration.json",
        "A simulated finger begins anywhere on the object, and nothing is known. It decides as the node explorer\n"
        "does: by what suggest_motion says, asked for slides or for lifts, too, or at random, until the filter is\n"
        "converged, it is said that nothing tells the remaining places apart, or the way is too long. Policies begin\n"
        "at the same places; that of an arm in MuJoCo (arm) over the object, which it presses and slides on.\n"
        "Codebooks and finished trials are kept in --out: the same command goes on where it was stopped.",
    )
    parser.add_argument("--trials", type=arguments.positive_int, default=10, help="per object and policy (default 10)")
    parser.add_argument("--policy", nargs="+", metavar="NAME", help="suggested, lifts, random (default: these), arm")
    parser.add_argument("--length", type=arguments.positive, default=1.0, help="given up after so many m (default 1)")
    parser.add_argument("--codebook-size", type=arguments.positive_int, default=50_000, help="poses (default 50000)")
    options.add_campaign_options(parser, "trial")


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    from ..statistics.exploring import summarise_exploration
    from ..trials.exploration import ExplorationPlan, chosen_policies

    cache = options.cache_of(args, codebook_size=args.codebook_size)
    config = options.single_threaded(args)
    plan = ExplorationPlan(cache, config, chosen_policies(args.policy), args.trials, args.length)
    trials, result = options.run_campaign(args, plan, "trial")
    result |= {"exploration": summarise_exploration(trials), "trials": trials}
    return options.conclude(args, "evaluate-exploration", result)
