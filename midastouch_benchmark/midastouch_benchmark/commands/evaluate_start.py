"""`midastouch evaluate-start`: time until there is a pose on an object that comes without a codebook."""

from __future__ import annotations

import argparse

from midastouch_tools.commands import arguments

from . import options


def add_parser(subparsers) -> None:
    """Add the sub-command."""
    parser = arguments.add_command(
        subparsers,
        "evaluate-start",
        run,
        "measure how soon there is a pose on an object that comes without a codebook",
        "midastouch evaluate-start --meshes ../shared/meshes/ycb --slides 10 --json out/start.json",
        "Of each object a filter is asked for as by set_object with the mesh alone, and then given the first touch of\n"
        "each slide. Slides are kept in --out, as by `midastouch benchmark`. Wall time: let nothing else run.",
    )
    parser.add_argument("--slides", type=arguments.positive_int, default=5, help="per object (default 5)")
    parser.add_argument("--length", type=arguments.positive, default=0.3, help="of a slide, m (default 0.3)")
    options.add_object_options(parser)


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    from midastouch_filter.loaded_object import SIZE
    from midastouch_tools.machine import machine_info
    from midastouch_tools.progress import progress_bar

    from ..speed.start import first_poses, summarise_first_poses
    from ..trials.cache import SlideKind
    from ..trials.object_sets import chosen_meshes
    from ..trials.setup import load_filter_config

    cache, config = options.cache_of(args, slides=SlideKind(args.length)), load_filter_config(args.config, args.preset)
    meshes = chosen_meshes(args.meshes, args.objects, args.out)
    machine, trials = machine_info(), []
    for mesh in progress_bar(iterable=meshes, unit="object"):
        trials += first_poses(mesh, cache, range(args.slides), config)
    settings = {"slides": args.slides, "slide_length_m": args.length, "codebook_size": SIZE}
    result = {
        "config": settings | {"networks": cache.describe()},
        "machine": machine,
        "start": summarise_first_poses(trials),
        "trials": trials,
    }
    return options.conclude(args, "evaluate-start", result)
