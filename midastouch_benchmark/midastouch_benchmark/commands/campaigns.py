"""Campaigns over objects: `midastouch identify`, `ideal-observer`, `evaluate-exploration`, `-motion` and `-start`."""

from __future__ import annotations

import argparse

from midastouch_tools.commands import arguments, limits

from . import options


def add_parser(subparsers) -> None:
    """Add the sub-commands."""
    _add_identify(subparsers)
    _add_ideal_observer(subparsers)
    _add_exploration(subparsers)
    _add_motion(subparsers)
    _add_start(subparsers)


def _add_identify(subparsers) -> None:
    parser = arguments.add_command(
        subparsers,
        "identify",
        _identify,
        "measure how well the objects of a catalogue are told apart, and others refused",
        "midastouch identify --meshes ../shared/meshes/ycb --slides 10 --json out/identify.json",
        "Each trial slides 0.3 m over one object, of which nothing is known at the start: once with the object in the\n"
        "catalogue, and once left out of it. Slides, codebooks and finished trials are kept in --out, as by\n"
        "`midastouch benchmark`: the same command continues where it was stopped.",
    )
    parser.add_argument("--slides", type=limits.count, default=5, help="per object (default 5)")
    parser.add_argument("--length", type=limits.path_length, default=0.3, help="of a slide, m (default 0.3)")
    parser.add_argument("--codebook-size", type=limits.poses, default=50_000, help="poses of an object (default 50000)")
    options.add_campaign_options(parser, "slide")


def _identify(args: argparse.Namespace) -> int:
    from ..statistics.exploring import summarise_identification
    from ..trials.cache import SlideKind
    from ..trials.identification import IdentityPlan

    cache = options.cache_of(args, slides=SlideKind(args.length), codebook_size=args.codebook_size)
    meshes = options.meshes_of(args)
    catalogue = tuple(mesh.path for mesh in meshes)
    plan = IdentityPlan(cache, options.single_threaded(args), tuple(range(args.slides)), catalogue)
    slides, result = options.run_campaign(args, plan, meshes)
    trials = [trial for slide in slides for trial in slide["trials"]]
    summary = summarise_identification(trials) if trials else None
    result |= {"catalogue": [mesh.name for mesh in meshes], "identification": summary, "trials": trials}
    return options.conclude(args, "identify", result)


def _add_ideal_observer(subparsers) -> None:
    parser = arguments.add_command(
        subparsers,
        "ideal-observer",
        _ideal_observer,
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
    parser.add_argument("--slides", type=limits.count, default=5, help="per object (default 5)")
    parser.add_argument("--length", type=limits.path_length, help="of a slide, m (default: the protocol's)")
    parser.add_argument("--codebook-size", type=limits.poses, default=10_000, help="poses (default 10000)")
    options.add_campaign_options(parser, "slide")


def _ideal_observer(args: argparse.Namespace) -> int:
    from ..statistics.exploring import summarise_observing
    from ..trials.observed_slides import EVIDENCE, ObservedPlan, chosen_observed
    from ..trials.protocols import PROTOCOLS

    protocol = chosen_observed(args.protocol)
    slides = PROTOCOLS[protocol].slides.of_length(args.length)
    cache = options.cache_of(args, slides=slides, codebook_size=args.codebook_size)
    config, evidence = options.single_threaded(args), tuple(dict.fromkeys(args.evidence or EVIDENCE))
    plan = ObservedPlan(cache, config, evidence, tuple(range(args.slides)), protocol)
    trials, result = options.run_campaign(args, plan, options.meshes_of(args))
    summary = summarise_observing(trials, evidence, config.keyframe_spacing)
    return options.conclude(args, "ideal-observer", result | {"ideal_observer": summary, "trials": trials})


def _add_exploration(subparsers) -> None:
    parser = arguments.add_command(
        subparsers,
        "evaluate-exploration",
        _exploration,
        "measure how far a finger slides until the filter has converged, where it is told to and at random",
        "midastouch evaluate-exploration --meshes ../shared/meshes/ycb --trials 10 --json out/exploration.json",
        "A simulated finger begins anywhere on the object, and nothing is known. It decides as the node explorer\n"
        "does: by what suggest_motion says, asked for slides or for lifts, too, or at random, until the filter is\n"
        "converged, it is said that nothing tells the remaining places apart, or the way is too long. Policies begin\n"
        "at the same places; that of an arm in MuJoCo (arm) over the object, which it presses and slides on.\n"
        "Codebooks and finished trials are kept in --out: the same command continues where it was stopped.",
    )
    parser.add_argument("--trials", type=limits.count, default=10, help="per object and policy (default 10)")
    parser.add_argument("--policy", nargs="+", metavar="NAME", help="suggested, lifts, random (default: these), arm")
    parser.add_argument(
        "--length", type=limits.path_length, default=1.0, help="give up after this path [m] (default 1)"
    )
    parser.add_argument("--codebook-size", type=limits.poses, default=50_000, help="poses (default 50000)")
    options.add_campaign_options(parser, "trial")


def _exploration(args: argparse.Namespace) -> int:
    from ..statistics.exploring import summarise_exploration
    from ..trials.exploration import ExplorationPlan, chosen_policies

    policies, meshes = chosen_policies(args.policy), options.meshes_of(args)
    cache, config = options.cache_of(args, codebook_size=args.codebook_size), options.single_threaded(args)
    catalogue = tuple(mesh.path for mesh in meshes)
    plan = ExplorationPlan(cache, config, policies, args.trials, args.length, catalogue)
    trials, result = options.run_campaign(args, plan, meshes)
    result |= {"exploration": summarise_exploration(trials), "trials": trials}
    return options.conclude(args, "evaluate-exploration", result)


def _add_motion(subparsers) -> None:
    parser = arguments.add_command(
        subparsers,
        "evaluate-motion",
        _motion,
        "measure how an arm in MuJoCo touches and slides by what the depth network reads, and how it stops",
        "midastouch evaluate-motion --meshes ../shared/meshes/ycb --trials 20 --json out/motion.json",
        "A UR in MuJoCo approaches an object somewhere, slides on, and on another slide something goes wrong. Camera,\n"
        "light, delays, friction, the error of the mount and how firmly the object is held are drawn at random.\n"
        "Finished trials are kept in --out: the same command continues where it was stopped. Needs the mujoco extra.",
    )
    options.add_meshes_options(parser)
    options.add_out_option(parser)
    parser.add_argument("--trials", type=limits.count, default=20, help="on each object (default 20)")
    options.add_sensor_option(parser, options.SIMULATED)
    options.add_workforce_options(parser, "trial")
    options.add_json_option(parser)


def _motion(args: argparse.Namespace) -> int:
    from midastouch_simulation.mujoco_arm import require_mujoco

    from ..trials.motion import MotionPlan

    require_mujoco()
    plan = MotionPlan(args.trials, args.sensor, args.out)
    trials, result = options.run_campaign(args, plan, options.meshes_of(args))
    return options.conclude(args, "evaluate-motion", result | {"trials": trials})


def _add_start(subparsers) -> None:
    parser = arguments.add_command(
        subparsers,
        "evaluate-start",
        _start,
        "measure how soon there is a pose on an object that comes without a codebook",
        "midastouch evaluate-start --meshes ../shared/meshes/ycb --slides 10 --json out/start.json",
        "Of each object a filter is asked for as by set_object with the mesh alone, and then given the first touch of\n"
        "each slide. Slides are kept in --out, as by `midastouch benchmark`. Wall time: let nothing else run.",
    )
    parser.add_argument("--slides", type=limits.count, default=5, help="per object (default 5)")
    parser.add_argument("--length", type=limits.path_length, default=0.3, help="of a slide, m (default 0.3)")
    options.add_object_options(parser)


def _start(args: argparse.Namespace) -> int:
    from midastouch_filter.loaded_object import SIZE
    from midastouch_tools.machine import machine_info
    from midastouch_tools.progress import progress_bar

    from ..speed.start import first_poses, summarise_first_poses
    from ..trials.cache import SlideKind
    from ..trials.setup import load_filter_config

    cache, config = options.cache_of(args, slides=SlideKind(args.length)), load_filter_config(args.config, args.preset)
    machine, trials = machine_info(), []
    for mesh in progress_bar(iterable=options.meshes_of(args), unit="object"):
        trials += first_poses(mesh, cache, range(args.slides), config)
    settings = {"slides": args.slides, "slide_length_m": args.length, "codebook_size": SIZE}
    result = {
        "config": settings | {"networks": cache.describe()},
        "machine": machine,
        "start": summarise_first_poses(trials),
        "trials": trials,
    }
    return options.conclude(args, "evaluate-start", result)
