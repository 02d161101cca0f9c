"""`midastouch single-touch`: how far one touch alone tells where the sensor is."""

from __future__ import annotations

import argparse

from . import arguments


def add_parser(subparsers) -> None:
    """Add the sub-command."""
    parser = arguments.add_command(
        subparsers,
        "single-touch",
        run,
        "measure how far a single touch tells where the sensor is",
        "midastouch single-touch --codebook out/codebooks/handle_tool.npz --queries 2000",
        "Fresh poses, each few seen by another simulated sensor, through both networks; for each the\n"
        "smallest pose error among the 25 best matches, over that of a random touch (paper figures 4 and 14).",
    )
    parser.add_argument("--mesh", help="mesh file or a bundled object (default: what the codebook was built from)")
    parser.add_argument("--codebook", required=True, metavar="FILE", help="codebook of the object")
    parser.add_argument("--queries", type=arguments.positive_int, default=10_000, help="touches (default 10000)")
    parser.add_argument("--seed", type=arguments.seed, default=0, help="of the touches (default 0)")
    arguments.add_network_options(parser)
    parser.add_argument("--json", metavar="OUT", help="write the results here")


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    from pathlib import Path

    import numpy as np

    from midastouch_perception.files import require_file

    from ..evaluation.machine import machine_info
    from ..evaluation.result_file import write_json
    from ..evaluation.setup import Networks
    from ..evaluation.single_touch import simulated_touches, single_touch_errors
    from ..evaluation.table import number, text_table
    from ..progress import progress_bar

    require_file(args.codebook, "codebook")
    networks = Networks.load(args.tdn, args.tcn, args.sensor)
    mesh, codebook = arguments.load_object(Path(args.codebook).stem, args.mesh, args.codebook, networks)
    rng = np.random.default_rng(args.seed)
    with progress_bar(total=args.queries, unit="touch", desc=mesh.name) as bar:
        poses, codes = simulated_touches(mesh, networks, args.queries, rng, bar.update)
    errors = single_touch_errors(codebook.poses, codebook.codes, poses, codes, rng)
    summary = errors.summary()
    if args.json:
        content = {
            "object": mesh.name,
            "queries": args.queries,
            "networks": networks.describe(),
            "codebook": dict(codebook.meta),
            "machine": machine_info(),
            "summary": summary,
            "errors": np.round(errors.best / errors.random.mean(), 4),
        }
        write_json(args.json, content)
    row = [mesh.name, args.queries, *(number(summary[k], 3) for k in summary if k != "random_error")]
    header = ["object", "touches", "normalised top-25 error", "median", "same, geodesic"]
    print(text_table([*header, "random touch mm"], [[*row, number(1e3 * summary["random_error"])]]))
    return 0
