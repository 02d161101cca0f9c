"""`midastouch single-touch`: errors of poses that are found by one touch alone."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from midastouch_common.errors import InputError
from midastouch_common.output_paths import codebook_path
from midastouch_tools.commands import arguments, limits

from . import options

if TYPE_CHECKING:
    from midastouch_common.mesh import ObjectMesh
    from midastouch_perception.codebook import Codebook

    from ..trials.setup import Networks


def add_parser(subparsers) -> None:
    """Add the sub-command."""
    parser = arguments.add_command(
        subparsers,
        "single-touch",
        run,
        "measure how far a single touch tells where the sensor is",
        "midastouch single-touch handle_tool eyebolt --queries 2000 --json out/single_touch.json",
        "Fresh poses, every 20 seen by another simulated sensor, through both networks; for each the smallest pose\n"
        "error among the 25 best matches, over that among 25 random ones (paper figures 4 and 14).",
    )
    parser.add_argument("meshes", nargs="*", default=[], metavar="MESH", help="mesh files or bundled objects")
    parser.add_argument("--mesh", help="the same, for one object (default: what the codebook was built from)")
    parser.add_argument(
        "--codebook", metavar="FILE", help="of one object, or folder of build-codebook (default out/codebooks)"
    )
    parser.add_argument("--queries", type=limits.queries, default=10_000, help="per object (default 10000)")
    parser.add_argument("--seed", type=limits.seed, default=0, help="of the touches (default 0)")
    parser.add_argument(
        "--lighting",
        choices=("tacto", "random"),
        default="tacto",
        help="TACTO's optics, or those of the training's randomisation (default tacto)",
    )
    parser.add_argument(
        "--backgrounds",
        metavar="DIR",
        help="real no-contact images; those held out of the training are used (default: invented ones)",
    )
    # in the commands of stored reports, where it turned off a comparison that is no longer made
    parser.add_argument("--baseline-size", choices=("0",), help=argparse.SUPPRESS)
    parser.add_argument(
        "--exhaustive",
        type=limits.seed,
        default=0,
        metavar="N",
        help="touches per object that are also compared, map by map, with each pose of a book: what no code can beat; "
        "some seconds each (default 0)",
    )
    options.add_network_options(parser)
    options.add_json_option(parser)


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    import numpy as np

    from midastouch_common.files import require_file
    from midastouch_tools.progress import progress_bar

    from ..single_touch.per_object import SingleTouchPlan, measure_object, summarise_objects
    from ..single_touch.simulated_touch import Lighting
    from ..trials.setup import Networks

    wanted = _wanted(args)
    for _, codebook in wanted:
        if codebook:
            require_file(codebook, "codebook")
    networks = Networks.load(args.tdn, args.tcn, args.sensor)
    lighting = Lighting.load(args.lighting, args.backgrounds, networks.sensor)
    plan = SingleTouchPlan(args.queries, lighting, args.exhaustive)
    # all of them before the first is measured, so that missing files show at once
    objects = [_load(args, mesh, codebook, networks) for mesh, codebook in wanted]
    results = []
    for mesh, book, path in objects:
        # the seed of an object does not depend on which others are measured
        rng = np.random.default_rng([args.seed, int(mesh.sha256[:8], 16)])
        with progress_bar(total=plan.touches, unit="touch", desc=mesh.name) as bar:
            result = measure_object(mesh, book, networks, plan, rng, bar.update)
        files = {"mesh": mesh.path, "codebook_file": path.resolve(), "codebook": dict(book.meta)}
        results.append(files | result)
    content = {
        **summarise_objects(results),
        "config": {
            "seed": args.seed,
            "lighting": args.lighting,
            "backgrounds": args.backgrounds,
            "exhaustive": args.exhaustive,
            "networks": networks.describe(),
        },
    }
    return options.conclude(args, "single-touch", content)


def _wanted(args: argparse.Namespace) -> list[tuple[str | None, Path | None]]:
    """Return (mesh or None, codebook or None) per object, as asked for."""
    meshes = [*args.meshes, *([args.mesh] if args.mesh else [])]
    if args.codebook is None or Path(args.codebook).is_dir():
        if not meshes:
            raise InputError("no object to touch; give mesh files or bundled objects, or --codebook FILE")
        folder = args.codebook and Path(args.codebook)
        return [(mesh, folder and folder / codebook_path(Path(mesh).stem, args.sensor).name) for mesh in meshes]
    if len(meshes) > 1:
        raise InputError(f"{args.codebook}: one codebook for {len(meshes)} objects; give the folder that holds theirs")
    return [(meshes[0] if meshes else None, Path(args.codebook))]


def _load(
    args: argparse.Namespace, mesh: str | None, codebook: Path | None, networks: Networks
) -> tuple[ObjectMesh, Codebook, Path]:
    path = codebook or codebook_path(Path(mesh).stem, networks.sensor.name)
    name, given = Path(mesh or path).stem, str(codebook) if codebook else None
    return *options.load_object(name, mesh, given, networks, args.sensor, args.tcn), path
