"""Common parts of the commands that measure: options, an object and its codebook, workers and deadline, the end."""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from midastouch_common.errors import InputError
from midastouch_common.missing_modules import install_extra
from midastouch_common.output_paths import SIMULATED, codebook_path
from midastouch_filter.core.presets import PRESETS_IN_WORDS
from midastouch_tools.commands import arguments, limits

if TYPE_CHECKING:
    from midastouch_common.mesh import ObjectMesh
    from midastouch_filter.core.config import FilterConfig
    from midastouch_perception.codebook import Codebook
    from midastouch_tools.jobs import Workers

    from ..trials.cache import Cache
    from ..trials.campaign import Plan
    from ..trials.setup import Networks
    from ..trials.trial_log import Campaign


def add_network_options(parser: argparse.ArgumentParser, sensor: str = SIMULATED) -> None:
    """Add --tdn, --tcn and --sensor, with which `Networks.load` is called; sensor: the default, "" the sequences'."""
    add_tdn_option(parser)
    parser.add_argument("--tcn", default="fast", metavar="NET", help="code network, name or file (default fast)")
    add_sensor_option(parser, sensor)


def add_tdn_option(parser: argparse.ArgumentParser) -> None:
    """Add --tdn, as `load_tdn` takes it."""
    parser.add_argument("--tdn", default="fast", metavar="NET", help="depth network, name or file (default fast)")


def add_sensor_option(parser: argparse.ArgumentParser, default: str) -> None:
    """Add --sensor; default: "" for the one that the sequences were recorded with."""
    words = default or "the one that the sequences were recorded with"
    parser.add_argument("--sensor", default=default, help=f"sensor model (default {words})")


def add_sequence_options(parser: argparse.ArgumentParser) -> None:
    """Add --background and --calibration, which `untouched_of` and the networks are given."""
    parser.add_argument(
        "--background", metavar="IMAGE", help="no-contact image of the sensor (default: the sequence's, else estimated)"
    )
    parser.add_argument("--calibration", metavar="FILE", help="the sensor's, by midastouch calibrate (default: none)")


def add_filter_options(parser: argparse.ArgumentParser) -> None:
    """Add --config and --preset, with which `load_filter_config` is called."""
    parser.add_argument("--config", metavar="YAML", help="filter settings, or a ROS parameter file")
    parser.add_argument(
        "--preset",
        metavar="NAME",
        help=f"filter settings between run time and error ({PRESETS_IN_WORDS}); those in --config go over them",
    )


def how_to_build(mesh: str, sensor: str, tcn: str, out: str = "") -> str:
    """Return `build_command` without options whose values are the command's own defaults."""
    from midastouch_perception.codebook import build_command

    return build_command(mesh, "" if sensor == SIMULATED else sensor, "" if tcn == "fast" else tcn, out)


def load_object(
    object_name: str, mesh: str | None, codebook: str | None, networks: Networks, sensor: str = "", tcn: str = "fast"
) -> tuple[ObjectMesh, Codebook]:
    """Return mesh and codebook of an object, found by name if no path is given.

    By default the codebook is the one that `build-codebook` makes of the mesh or, without that file, of the object; the
    mesh is the file that the codebook was built from. Raises InputError with the command or option that helps, if one
    is not found, or if they do not belong together. sensor, tcn: as on the command line, for that command; sensor "":
    by its name.
    """
    from midastouch_perception.codebook import Codebook
    from midastouch_perception.objects import bundled_objects

    loaded = arguments.load_mesh(mesh) if mesh else None
    # a trial's mesh seldom has the trial's name: it is that object in the recording's frame
    names = [Path(mesh).stem, object_name] if mesh else [object_name]
    default = [codebook_path(name, networks.sensor.name) for name in names]
    path = Path(codebook) if codebook else next((each for each in default if each.is_file()), default[0])
    if not path.exists():
        built_from = mesh or (object_name if object_name in bundled_objects() else "MESH")
        command = how_to_build(built_from, sensor or networks.sensor.name, tcn, str(path))
        images = f"these images, of {sensor or networks.sensor.name}"
        raise InputError(f"{path}: no codebook of {names[0]} for {images}; build it: {command}")
    if loaded is None:
        mesh = Codebook.load(path).meta.get("mesh_path", "")
        if not Path(mesh).is_file():
            raise InputError(f"{path}: its mesh '{mesh}' is not there any more; give it with --mesh")
        loaded = arguments.load_mesh(mesh)
    book = Codebook.load(path, mesh=loaded, tcn=networks.tcn.network_id)
    if book.meta["sensor_id"] != networks.sensor.content_id:
        command = how_to_build(str(mesh), sensor or networks.sensor.name, tcn)
        fault = f"built for the sensor {book.meta['sensor']}, not for {networks.sensor.name}"
        raise InputError(f"{path}: {fault}; build one for it: {command}")
    return loaded, book


def add_json_option(parser: argparse.ArgumentParser) -> None:
    """Add --json, which `conclude` takes."""
    arguments.add_place(parser, "--json", "file", "write the results here", metavar="OUT")


def conclude(args: argparse.Namespace, kind: str, result: dict, *notes: str, also: Sequence[str] = ()) -> int:
    """Print the tables of `result`; write it to the file of --json, with the command line that made it, its fingerprint
    and, unless it has one already, the machine.

    kind: one of `EXPERIMENTS`; notes: further lines; also: parts of the fingerprint on which this result depends, too.
    Returns the exit status.
    """
    from midastouch_tools.machine import machine_info
    from midastouch_tools.result_file import DIGITS, to_json, write_compact_json

    from ..tables.experiments import EXPERIMENTS
    from ..tables.table import shown

    experiment, result = EXPERIMENTS[kind], to_json({"machine": machine_info()} | result, DIGITS)
    left = [
        f"{unit}s left: {result[key]}; the same command continues with them"
        for key, unit in (("missing_trials", "trial"), ("missing_slides", "slide"))
        if result.get(key)
    ]
    try:
        lines = [shown(experiment.tables(result)), *experiment.notes(result), *notes, *left]
        print("\n".join(line for line in lines if line), flush=True)
    finally:  # also if nobody reads on, as after `| head`
        if args.json:
            from ..evidence.fingerprint import today

            content = {"command": args.command_line, **result}
            write_compact_json(args.json, content)  # first: the fingerprint may take minutes
            made = "+".join(today()[part] for part in (*experiment.parts, *also))
            write_compact_json(args.json, {"fingerprint": made} | content)
    return 0


def add_campaign_options(parser: argparse.ArgumentParser, unit: str) -> None:
    """Add the options of every campaign: those of `add_object_options`, workers and time. unit: name of one trial."""
    add_object_options(parser)
    add_workforce_options(parser, unit)


def add_workforce_options(parser: argparse.ArgumentParser, unit: str) -> None:
    """Add the options of workers and time that `campaign` takes. unit: name of one trial."""
    arguments.add_jobs_option(parser)
    parser.add_argument("--cluster", metavar="ADDRESS", help="of a Dask scheduler, such as tcp://10.0.0.1:8786")
    parser.add_argument("--minutes", type=limits.minutes, help=f"start no {unit} after this time")


def add_meshes_options(parser: argparse.ArgumentParser) -> None:
    """Add --meshes and --objects, as `chosen_meshes` takes them."""
    parser.add_argument("--meshes", metavar="DIR", help="folder of mesh files (default: the bundled objects)")
    parser.add_argument(
        "--objects",
        nargs="+",
        metavar="NAME",
        help="names, or how they begin; held_out: ten further of YCB; all: of the folder; made by code: cad (parts of "
        "60 to 160 mm), small_parts and small_cad (smaller than the gel) (default: the paper's ten of --meshes, all of "
        "the bundled)",
    )


def add_out_option(parser: argparse.ArgumentParser) -> None:
    """Add --out, the folder of a campaign."""
    arguments.add_place(parser, "--out", "folder", "", "out/benchmark", help="default out/benchmark")


def add_object_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of objects, folder, settings and networks, and --json."""
    add_meshes_options(parser)
    add_out_option(parser)
    add_filter_options(parser)
    add_network_options(parser)
    add_json_option(parser)


def campaign_folder(args: argparse.Namespace, *parts: str) -> Path:
    """Return the folder in --out for slides made by today's code, and for all that depends on them and on these parts
    of the fingerprint; that of other code is kept apart."""
    from ..evidence.fingerprint import today

    made_by = "+".join(today()[part] for part in ("slides", *parts))
    return args.out.resolve() / made_by  # workers may run elsewhere


def cache_of(args: argparse.Namespace, **settings: Any) -> Cache:
    """Return the cache of a campaign with the networks and the sensor of the options; settings: further ones of it."""
    from ..trials.cache import Cache

    return Cache(campaign_folder(args), args.tdn, args.tcn, args.sensor, **settings)


def single_threaded(args: argparse.Namespace) -> FilterConfig:
    """Return the filter settings of the options for a filter that runs next to others."""
    import dataclasses

    from ..trials.setup import load_filter_config

    return dataclasses.replace(load_filter_config(args.config, args.preset), threads=1)


CONNECT_S = 10.0  # s


@contextmanager
def open_cluster(address: str) -> Iterator[Workers]:
    """Open the workers of the Dask scheduler at an address such as tcp://10.0.0.1:8786.

    Raises InputError without Dask, if no scheduler answers, and if workers die again and again.
    """
    from midastouch_tools.jobs import Workers

    try:
        from distributed import Client, KilledWorker

        client = Client(address, timeout=CONNECT_S)
    except ImportError as error:
        raise InputError(f"--cluster needs Dask; install it: {install_extra('cluster')}") from error
    except (OSError, ValueError) as error:
        raise InputError(f"{address}: no scheduler answers ({error}); start one: dask scheduler") from error
    with client:
        try:
            # not pure: Dask would reuse the result of an earlier task with the same arguments
            yield Workers(client.get_executor(pure=False), lambda: len(client.nthreads()))
        except KilledWorker as error:
            raise InputError(f"workers died again and again ({error}); give each more memory") from error


def meshes_of(args: argparse.Namespace) -> list[ObjectMesh]:
    """Return the objects of a campaign; InputError for a name that fits none or several."""
    from ..trials.object_sets import chosen_meshes

    return chosen_meshes(args.meshes, args.objects, args.out)


def run_campaign(args: argparse.Namespace, plan: Campaign | Plan, meshes: list[ObjectMesh]) -> tuple[list[dict], dict]:
    """Run a campaign over these objects with the workers of the options; return its trials, and the first entries of
    its result: config, machine and the number of missing units."""
    from midastouch_tools.jobs import open_workers
    from midastouch_tools.machine import machine_info

    machine = machine_info()
    deadline = time.monotonic() + 60 * args.minutes if args.minutes else math.inf
    with open_cluster(args.cluster) if args.cluster else open_workers(args.jobs) as workers:
        trials, missing = plan.run(meshes, workers, deadline)
    config = plan.describe() | {"jobs": args.jobs, "cluster": args.cluster}
    return trials, {"config": config, "machine": machine, f"missing_{plan.UNIT}s": missing}
