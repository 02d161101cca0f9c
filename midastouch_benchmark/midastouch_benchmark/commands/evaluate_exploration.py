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
    import dataclasses

    from midastouch_tools.machine import machine_info

    from ..statistics.exploring import summarise_exploration
    from ..tables.exploring import exploration_table
    from ..tables.table import terminal
    from ..trials.cache import Cache
    from ..trials.exploration import ExplorationPlan, chosen_policies, run_exploration
    from ..trials.object_sets import chosen_meshes
    from ..trials.setup import load_filter_config
    from ..trials.trial_log import TrialLog

    folder = options.campaign_folder(args)
    cache = Cache(folder, args.tdn, args.tcn, args.sensor, codebook_size=args.codebook_size)
    config = dataclasses.replace(load_filter_config(args.config, args.preset), threads=1)
    plan = ExplorationPlan(cache, config, chosen_policies(args.policy), args.trials, args.length)
    meshes = chosen_meshes(args.meshes, args.objects, args.out)
    with options.campaign(args, "trial") as workforce:
        trials, missing = run_exploration(plan, meshes, TrialLog(folder / "exploration.jsonl"), workforce)
    summary = summarise_exploration(trials)
    config_used = plan.describe()
    result = {
        "config": config_used,
        "machine": machine_info(),
        "missing_trials": missing,
        "exploration": summary,
        "trials": trials,
    }
    table = terminal(exploration_table(trials, config_used["policies"]))
    return options.conclude(args, result, table, *options.left(missing, "trial"))
