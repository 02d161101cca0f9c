"""`midastouch benchmark`: accuracy over objects, against the paper's filter and with each mechanism switched off."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from . import arguments

if TYPE_CHECKING:
    from pathlib import Path

    from midastouch_perception.mesh import ObjectMesh

TEST_OBJECTS = ("004", "005", "006", "021", "025", "035", "037", "042", "048", "055")
"""The paper's ten, by their YCB numbers."""

_DISTURBANCES = ("tool_bias", "time_offset", "rest", "slow_camera", "lift", "kidnap")
_PROTOCOLS = ("plain", *_DISTURBANCES, "real_sensor", "real_sensor_calibrated")


def add_parser(subparsers) -> None:
    """Add the sub-command."""
    parser = arguments.add_command(
        subparsers,
        "benchmark",
        run,
        "measure accuracy over objects on simulated slides, and compare variants of the filter",
        "midastouch benchmark --meshes ../shared/meshes/ycb --variant paper --jobs 2 --json out/accuracy.json",
        "Slides, codebooks and what the networks make of the slides are made once and kept in --out, as is every\n"
        "finished trial: the same command goes on where it was stopped. --variant takes names and sets:\n"
        "paper (the paper's filter), ablation (each mechanism and gate off), gates, counts (fewer particles),\n"
        "codebooks (fewer poses, shorter codes), front (what error is set against run time for), all.",
    )
    parser.add_argument("--meshes", metavar="DIR", help="folder of mesh files (default: the bundled objects)")
    parser.add_argument(
        "--objects",
        nargs="+",
        metavar="NAME",
        help="names, or how they begin (default: the paper's ten of --meshes, all of the bundled)",
    )
    parser.add_argument("--out", metavar="DIR", default="out/benchmark", help="default out/benchmark")
    parser.add_argument("--slides", type=arguments.positive_int, default=5, help="per object (default 5)")
    parser.add_argument("--length", type=arguments.positive, default=0.5, help="of a slide, m (default 0.5)")
    parser.add_argument("--seeds", type=arguments.positive_int, default=10, help="trials per slide (default 10)")
    parser.add_argument(
        "--init", nargs="+", choices=("paper", "uniform"), default=["paper", "uniform"], help="default: both"
    )
    parser.add_argument("--beta", type=arguments.positive, default=1.0, help="width of `--init paper` (default 1)")
    parser.add_argument("--stride", type=arguments.positive_int, default=1, help="use every n-th frame (default 1)")
    parser.add_argument(
        "--variant", nargs="+", default=[], metavar="NAME", help="compared with the default, on the same slides"
    )
    parser.add_argument(
        "--protocol",
        choices=_PROTOCOLS,
        default="plain",
        help="what is done to the slides: a tool 2 mm, 2 deg off; poses 50 ms late; stops of 1 s; every image twice; "
        "lifted and put down 50 mm away; the same, untold; seen by sensors measured on real gel, without and with a "
        "calibration from ten presses of a ball (default plain)",
    )
    parser.add_argument("--config", metavar="YAML", help="filter settings of the default, or a ROS parameter file")
    parser.add_argument("--codebook-size", type=arguments.positive_int, default=50_000, help="default 50000")
    parser.add_argument("--jobs", type=arguments.positive_int, default=1, help="processes (default 1)")
    parser.add_argument("--minutes", type=arguments.positive, help="start no trial after this time")
    arguments.add_network_options(parser)
    parser.add_argument("--json", metavar="OUT", help="write the results here")


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    from contextlib import ExitStack
    from functools import partial
    from pathlib import Path

    from ..evaluation.accuracy import accuracy_text, compact_trials, summarise_accuracy
    from ..evaluation.calibration import LEVELS
    from ..evaluation.campaign import Plan, likelihood_levels, run_campaign
    from ..evaluation.comparison import compare_variants
    from ..evaluation.machine import machine_info
    from ..evaluation.real_sensor import REAL_SENSORS, RealSensorStock
    from ..evaluation.result_file import write_compact_json
    from ..evaluation.setup import load_filter_config
    from ..evaluation.stock import Stock
    from ..evaluation.trial_log import TrialLog
    from ..evaluation.variants import VARIANTS, chosen_variants
    from ..progress import progress_bar

    folder = Path(args.out)
    calibrated = REAL_SENSORS.get(args.protocol)
    make_stock = Stock if calibrated is None else partial(RealSensorStock, calibrated=calibrated)
    stock = make_stock(folder, args.tdn, args.tcn, args.sensor, args.length, args.codebook_size)
    plan = Plan(
        stock,
        load_filter_config(args.config),
        tuple(chosen_variants(args.variant)),
        tuple(dict.fromkeys(args.init)),
        args.beta,
        tuple(range(args.slides)),
        tuple(range(args.seeds)),
        args.stride,
        args.protocol,
    )
    meshes = _meshes(args.meshes, args.objects)
    log = TrialLog(folder / "trials.jsonl")
    machine = machine_info()
    with ExitStack() as bars:

        def start_progress(total: int):
            return bars.enter_context(progress_bar(total=total, unit="trial")).update

        trials, missing = run_campaign(plan, meshes, log, args.jobs, args.minutes or float("inf"), start_progress)
    levels = {mesh.name: likelihood_levels(plan, mesh, log) for mesh in meshes} if not missing else {}
    result = {
        "command": args.command_line,
        "config": plan.describe() | {"jobs": args.jobs},
        "machine": machine,
        "objects": [
            {
                "object": mesh.name,
                "diagonal_m": mesh.diagonal,
                "symmetry": stock.symmetry(mesh).describe(),
                "likelihood_levels": levels.get(mesh.name),
            }
            for mesh in meshes
        ],
        "variants": {name: VARIANTS[name].describe() for name in plan.variants},
        "levels": LEVELS,
        "missing_trials": missing,
        "summary": summarise_accuracy(trials),
        "comparison": compare_variants(trials),
        "trials": compact_trials(trials),
    }
    if args.json:
        write_compact_json(args.json, result)
    print(accuracy_text(result))
    if missing:
        print(f"{missing} trials are left; the same command goes on with them")
    return 0


def _meshes(folder: str | None, names: list[str] | None) -> list[ObjectMesh]:
    """The meshes asked for, by name; InputError for a name that fits none or several."""
    from pathlib import Path

    from midastouch_perception.errors import InputError
    from midastouch_perception.mesh import ObjectMesh
    from midastouch_perception.objects import bundled_objects

    if folder is None:
        available = bundled_objects()
        names = names or sorted(available)
    else:
        if not Path(folder).is_dir():
            raise InputError(f"{folder}: no such folder; give one with mesh files")
        files = [path for path in Path(folder).iterdir() if path.suffix.lower() in (".ply", ".stl", ".obj")]
        available = {path.stem: path for path in files}
        names = names or list(TEST_OBJECTS)
    return [ObjectMesh.load(_one(name, available, folder or "bundled objects")) for name in names]


def _one(name: str, available: dict[str, Path], where: str) -> Path:
    from midastouch_perception.errors import InputError

    fitting = [name] if name in available else sorted(one for one in available if one.startswith(name))
    if len(fitting) != 1:
        found = f"fits {', '.join(fitting)}" if fitting else f"there are {', '.join(sorted(available)) or 'none'}"
        raise InputError(f"{where}: no object '{name}': {found}; give its name with --objects")
    return available[fitting[0]]
