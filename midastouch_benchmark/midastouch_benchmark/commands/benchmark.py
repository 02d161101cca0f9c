"""`midastouch benchmark`: accuracy over objects, against the paper's filter and with each mechanism switched off."""

from __future__ import annotations

import argparse

from midastouch_tools.commands import arguments, limits

from . import options


def add_parser(subparsers) -> None:
    """Add the sub-command."""
    parser = arguments.add_command(
        subparsers,
        "benchmark",
        run,
        "measure accuracy over objects on simulated slides, and compare variants of the filter",
        "midastouch benchmark --meshes ../shared/meshes/ycb --variant paper --jobs 2 --json out/accuracy.json",
        "Slides, codebooks and what the networks make of the slides are made once and kept in --out, as is every\n"
        "finished trial: the same command continues where it was stopped. With --cluster, trials run on the workers\n"
        "of a Dask scheduler; they need this version of midastouch, and the folders of --out and --meshes.\n"
        "--variant takes names and sets:\n"
        "paper (the paper's filter), peers (that, registration of the contact cloud, odometry alone), ablation\n"
        "(each mechanism and gate off), gates, front (what error is set against run time for: presets, alignments,\n"
        "poses at the start and in the codebook),\n"
        "contacts (fewer fingers, for --protocol grasp), all.\n"
        "--protocol takes one of:\n"
        "  plain        nothing is wrong, paper's start     uniform      nothing known at the start\n"
        "  tool_bias    tool 2 mm, 2 deg off                late         poses 50 ms late\n"
        "  slow_camera  every image comes twice             rest         the arm rests in contact for 20 s\n"
        "  lift         lifted, put down 50 mm away         kidnap       the same, unreported\n"
        "  jump         30 mm, 175 deg in one step          unexplained  12 touches that nothing explains\n"
        "  push         the object moves by 5 mm, 5 deg     wrong_mesh   another object is touched\n"
        "  other_shape  the object is not quite its mesh    small_parts  parts smaller than the gel\n"
        "  grasp        held still by a thumb and two fingers for 5 s\n"
        "  pinch        pinched three times for 2 s by two fingers\n"
        "  real_sensor  seen by sensors measured on real gel; with --sensor digit_real\n"
        "  real_sensor_calibrated  the same, each calibrated with ten presses of a ball\n"
        "  camera_faults  16 faults of cameras, lamps and gels on those; 16 slides have one path",
    )
    parser.add_argument("--slides", type=limits.count, default=5, help="per object (default 5)")
    parser.add_argument("--length", type=limits.path_length, help="of a slide, m (default: as the protocol needs)")
    parser.add_argument(
        "--seeds", type=limits.count, default=10, help="trials per slide, alike unless a method draws (default 10)"
    )
    parser.add_argument(
        "--init", nargs="+", choices=("paper", "uniform"), help="starts (default: as the protocol has it)"
    )
    parser.add_argument("--stride", type=limits.count, default=1, help="use every n-th frame (default 1)")
    parser.add_argument(
        "--variant", nargs="+", default=[], metavar="NAME", help="compared with the default, on the same slides"
    )
    parser.add_argument(
        "--protocol",
        default="plain",
        metavar="NAME",
        help="what is done to the slides, and how trials start; see above (default plain)",
    )
    parser.add_argument("--codebook-size", type=limits.poses, help="poses (default: the protocol's)")
    options.add_campaign_options(parser, "trial")


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    from ..statistics.accuracy import compact_trials, summarise_accuracy
    from ..statistics.comparison import compare_variants
    from ..statistics.coverage import LEVELS
    from ..trials.campaign import Plan
    from ..trials.object_sets import chosen_meshes
    from ..trials.protocols import chosen_protocol
    from ..trials.setup import load_filter_config
    from ..trials.variants import VARIANTS, chosen_variants

    protocol, chosen = chosen_protocol(args.protocol), chosen_variants(args.variant)
    meshes = chosen_meshes(args.meshes, args.objects or protocol.objects, args.out)
    skipped = {name: reason for name in chosen if (reason := VARIANTS[name].missing)}
    also = ("real_gel",) if protocol.real_gel else ()
    folder, slides = options.campaign_folder(args, *also), protocol.slides.of_length(args.length)
    size = args.codebook_size or protocol.codebook_size
    plan = Plan(
        protocol.make_cache(folder, args.tdn, args.tcn, args.sensor, slides, size),
        load_filter_config(args.config, args.preset),
        tuple(name for name in chosen if name not in skipped),
        tuple(dict.fromkeys(args.init or protocol.starts)),
        protocol.beta,
        tuple(range(args.slides)),
        tuple(range(args.seeds)),
        args.stride,
        args.protocol,
    )
    trials, result = options.run_campaign(args, plan, meshes)
    result |= {
        "objects": [
            {"object": mesh.name, "diagonal_m": mesh.diagonal, "symmetry": plan.cache.symmetry(mesh).exact.describe()}
            for mesh in meshes
        ],
        "variants": {name: VARIANTS[name].describe() for name in plan.variants},
        # without the command after the colon, which names folders of this machine
        "skipped_variants": {name: reason.partition(":")[0] for name, reason in skipped.items()},
        "levels": LEVELS,
        "summary": summarise_accuracy(trials),
        "comparison": compare_variants(trials),
        "trials": compact_trials(trials),
    }
    left_out = [f"--variant {name}: skipped, {reason}" for name, reason in skipped.items()]
    return options.conclude(args, "benchmark", result, *left_out, also=also)
