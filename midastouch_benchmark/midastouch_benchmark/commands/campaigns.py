"""Campaigns of trials over many objects: their options, objects, workers and deadline."""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from midastouch_bringup.commands import arguments
from midastouch_common.errors import InputError

from . import options, outcome

if TYPE_CHECKING:
    from midastouch_common.mesh import ObjectMesh

    from ..trials.open_trials import Workforce

HELD_OUT = ("008", "019", "028", "032", "033", "043", "052", "065-c", "072-b", "073-a")
"""Ten more for judging, on which no setting is to be chosen. The networks were trained on 008, 028 and 033; the other
seven only validated."""


def add_campaign_options(parser: argparse.ArgumentParser, unit: str) -> None:
    """What every campaign is asked for: as `add_object_options`, workers and time. unit: what one trial is called."""
    add_object_options(parser)
    arguments.add_cluster_options(parser)
    parser.add_argument("--minutes", type=arguments.positive, help=f"start no {unit} after this time")


def add_object_options(parser: argparse.ArgumentParser) -> None:
    """Objects, folder, settings, networks, --json."""
    parser.add_argument("--meshes", metavar="DIR", help="folder of mesh files (default: the bundled objects)")
    parser.add_argument(
        "--objects",
        nargs="+",
        metavar="NAME",
        help="names, or how they begin; held_out: ten further of YCB; all: of the folder (default: the paper's ten of "
        "--meshes, all of the bundled)",
    )
    parser.add_argument("--out", metavar="DIR", default="out/benchmark", help="default out/benchmark")
    options.add_filter_options(parser)
    options.add_network_options(parser)
    outcome.add_json_option(parser)


def meshes_to_fit_on(folder: Path) -> list[Path]:
    """Mesh files of a folder that judge nothing: neither the paper's ten objects nor the ten held out."""
    from midastouch_perception.training.setting import TEST_OBJECTS

    return [path for path in sorted(folder.glob("*.ply")) if not path.stem.startswith((*TEST_OBJECTS, *HELD_OUT))]


def chosen_meshes(folder: str | None, names: list[str] | None) -> list[ObjectMesh]:
    """The meshes asked for, by name; InputError for a name that fits none or several."""
    from midastouch_common.mesh import ObjectMesh
    from midastouch_perception.objects import bundled_objects
    from midastouch_perception.training.setting import TEST_OBJECTS

    if folder is None:
        available = bundled_objects()
        names = names or sorted(available)
    else:
        if not Path(folder).is_dir():
            raise InputError(f"{folder}: no such folder; give one with mesh files")
        files = [path for path in Path(folder).iterdir() if path.suffix.lower() in (".ply", ".stl", ".obj")]
        available = {path.stem: path for path in files}
        if names == ["all"]:
            return [ObjectMesh.load(path) for path in sorted(files)]
        names = list(HELD_OUT) if names == ["held_out"] else names or list(TEST_OBJECTS)
    return [ObjectMesh.load(_one(name, available, folder or "bundled objects")) for name in names]


def _one(name: str, available: dict[str, Path], where: str) -> Path:
    fitting = [name] if name in available else sorted(one for one in available if one.startswith(name))
    if len(fitting) != 1:
        found = f"fits {', '.join(fitting)}" if fitting else f"there are {', '.join(sorted(available)) or 'none'}"
        raise InputError(f"{where}: no object '{name}': {found}; give its name with --objects")
    return available[fitting[0]]


@contextmanager
def campaign(args: argparse.Namespace, unit: str) -> Iterator[Workforce]:
    """Who runs the trials, by the options of a campaign."""
    from midastouch_bringup.cluster import open_cluster
    from midastouch_bringup.progress import progress_bar

    from ..trials.open_trials import Workforce

    with ExitStack() as opened:

        def start_progress(total: int) -> Callable[[int], object]:
            return opened.enter_context(progress_bar(total=total, unit=unit)).update

        deadline = time.monotonic() + 60 * args.minutes if args.minutes else math.inf
        cluster = opened.enter_context(open_cluster(args.jobs, args.cluster))
        yield Workforce(cluster, deadline, start_progress)


def left(missing: int, unit: str) -> list[str]:
    """A line on how a campaign goes on that its deadline has ended; none if nothing is missing."""
    return [f"{missing} {unit}s are left; the same command goes on with them"] if missing else []
