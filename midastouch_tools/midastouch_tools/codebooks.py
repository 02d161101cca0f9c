"""Building of codebooks with a progress bar, and reuse of those that exist."""

from __future__ import annotations

import contextlib
import os
import sys
import time
from functools import partial
from pathlib import Path

from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_common.output_paths import CACHED_CODEBOOKS, cached_codebook_path
from midastouch_filter.core.object_model import derived_arrays
from midastouch_perception.codebook import Codebook
from midastouch_perception.codebook_build import CodebookBuild
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.symmetry.group import Symmetry
from midastouch_perception.tcn import AnyCodeNet, load_tcn

from .progress import Bars

SAVE_INTERVAL_S = 30.0  # work that a kill or a power cut may cost


def build_and_save(
    mesh: ObjectMesh,
    tcn: AnyCodeNet,
    sensor: SensorModel,
    size: int,
    seed: int,
    path: str | Path,
    jobs: int | None,
    symmetry: Symmetry | None = None,
) -> tuple[Codebook, float]:
    """Build a codebook of `size` poses and write it to `path`; return it and the seconds it took.

    symmetry: of the object; None: it is searched for. jobs: chunks encoded at a time; None: one per core. An
    interrupted build keeps its progress next to `path`, and the next call for the same codebook continues there.
    """
    start = time.perf_counter()
    build = CodebookBuild(mesh, tcn, sensor, size, seed, symmetry)
    unfinished = Path(path).with_suffix(".unfinished.npz")
    if unfinished.is_file():
        try:
            build.restore(unfinished)
            print(f"{unfinished}: continuing after {build.done} of {size} poses", file=sys.stderr)
        except InputError as error:
            print(f"{error}; starting from the beginning", file=sys.stderr)
    saved, search = start, f"poses that reach {mesh.name}"

    def searched(found: int) -> None:
        nonlocal search
        if found < bars.of(search, "pose", size).n:
            search += ", of more places"  # too few did, and it begins again
        bar = bars.of(search, "pose", size)
        bar.update(found - bar.n)

    def tried() -> None:
        bars.of(f"symmetry of {mesh.name}", "motion").update()

    def progress(done: int, total: int) -> None:
        nonlocal saved
        bar = bars.of(f"codebook of {mesh.name}", "pose", total)
        bar.update(done - bar.n)
        if time.perf_counter() - saved > SAVE_INTERVAL_S:
            build.save(unfinished)
            saved = time.perf_counter()

    try:
        with contextlib.closing(Bars()) as bars:
            cores, inform = len(os.sched_getaffinity(0)), partial(print, file=sys.stderr)
            codebook = build.run(jobs or cores, progress, inform=inform, searched=searched, tried=tried)
            codebook.derived = derived_arrays(mesh, codebook)
    except BaseException:
        if build.done:
            build.save(unfinished)
            print(f"{unfinished}: keeps {build.done} of {size} poses; run it again to continue", file=sys.stderr)
        raise
    codebook.save(path)
    unfinished.unlink(missing_ok=True)
    return Codebook.load(path), time.perf_counter() - start  # a file is less precise: the first run is as the next


def cached_codebook(
    mesh: ObjectMesh,
    tcn: AnyCodeNet,
    sensor: SensorModel,
    size: int,
    folder: Path = CACHED_CODEBOOKS,
    jobs: int | None = None,
) -> Codebook:
    """Return the codebook of `size` poses of an object from an earlier call; build it if none fits."""
    return ensure_codebook(cached_codebook_path(mesh.name, size, folder), mesh, tcn, sensor, size, jobs)


def ensure_codebook(
    path: str | Path, mesh: ObjectMesh, tcn: AnyCodeNet, sensor: SensorModel, size: int, jobs: int | None = None
) -> Codebook:
    """Return the codebook at `path`; build one of `size` poses there if it is not of this mesh, network and sensor."""
    if (book := _fitting(path, mesh, tcn, sensor)) is not None:
        return book
    return build_and_save(mesh, tcn, sensor, size, 0, path, jobs)[0]


def _is_up_to_date(
    path: Path, mesh: ObjectMesh, tcn: AnyCodeNet, sensor: SensorModel, size: int, seed: int, symmetry: Symmetry | None
) -> bool:
    """Return whether `path` already holds the codebook that `build_and_save` would make of these arguments."""
    book = _fitting(path, mesh, tcn, sensor)
    if book is None or (book.meta["size"], book.meta["seed"]) != (size, seed) or book.symmetry is None:
        return False
    if symmetry is None:
        return not book.symmetry.given
    return book.symmetry.given and book.symmetry.exact.as_json() == symmetry.as_json()


def _fitting(path: str | Path, mesh: ObjectMesh, tcn: AnyCodeNet, sensor: SensorModel) -> Codebook | None:
    """The codebook at `path`; None if there is none of this mesh, network and sensor."""
    with contextlib.suppress(InputError):  # none yet, or of an older mesh or network
        book = Codebook.load(path, mesh=mesh, tcn=tcn.network_id)
        if book.meta["sensor_id"] == sensor.content_id:
            return book
    return None


def build_from_files(
    mesh: Path,
    tcn: str,
    sensor: str,
    size: int,
    seed: int,
    path: Path,
    force: bool,
    jobs: int,
    symmetry: Symmetry | None,
) -> str:
    """Build a codebook as `build_and_save` unless it is up to date, or in any case by `force`; return a line about it.

    tcn, sensor: names or files.
    """
    model = SensorModel.load(sensor)
    what = ObjectMesh.load(mesh), load_tcn(tcn, model), model, size, seed
    if not force and _is_up_to_date(path, *what, symmetry):
        return f"{path}: is up to date; --force builds it again"
    former = ""
    with contextlib.suppress(InputError):  # none yet, or one that cannot be read
        former = f"; in place of one of {len(Codebook.load(path).poses)} poses"
    book, seconds = build_and_save(*what, path, jobs, symmetry)
    poses, mebibytes = f"{len(book.poses)} poses of {book.meta['mesh_name']}", path.stat().st_size / 2**20
    return f"{path}: {poses}, {mebibytes:.1f} MiB, {seconds:.1f} s; symmetry: {book.symmetry.describe()}{former}"
