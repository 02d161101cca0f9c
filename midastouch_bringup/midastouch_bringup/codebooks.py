"""Codebooks built with a progress bar and kept for the next time."""

from __future__ import annotations

import os
import time
from pathlib import Path

from midastouch_perception.codebook import Codebook, build_codebook
from midastouch_perception.errors import InputError
from midastouch_perception.mesh import ObjectMesh
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tcn import TactileCodeNet

from .progress import progress_bar

CODEBOOK_FOLDER = Path("out/codebooks")
_CACHE = Path("out/cache/codebooks")


def codebook_path(object_name: str) -> Path:
    """Where `midastouch build-codebook` puts, and `midastouch evaluate` looks for, the codebook of an
    object."""
    return CODEBOOK_FOLDER / f"{object_name}.npz"


def build_and_save(
    mesh: ObjectMesh,
    tcn: TactileCodeNet,
    sensor: SensorModel,
    size: int,
    seed: int,
    path: str | os.PathLike,
) -> tuple[Codebook, float]:
    """Build a codebook of `size` poses and write it to `path`; returns it and the seconds it took."""
    start = time.perf_counter()
    with progress_bar(total=size, unit="pose", desc=f"codebook of {mesh.name}") as bar:
        codebook = build_codebook(mesh, tcn, sensor, size, seed, lambda done, total: bar.update(done - bar.n))
    codebook.save(path)
    return codebook, time.perf_counter() - start


def cached_codebook(
    mesh: ObjectMesh, tcn: TactileCodeNet, sensor: SensorModel, size: int, folder: Path = _CACHE
) -> Codebook:
    """The codebook of `size` poses of an object from an earlier call, built if there is none that fits."""
    path = cached_codebook_path(mesh, size, folder)
    try:
        return Codebook.load(path, mesh=mesh, tcn=tcn.network_id)
    except InputError:  # none yet, or of an older mesh or network
        return build_and_save(mesh, tcn, sensor, size, 0, path)[0]


def cached_codebook_path(mesh: ObjectMesh, size: int, folder: Path = _CACHE) -> Path:
    """Where `cached_codebook` keeps it."""
    return folder / f"{mesh.name}_{size}.npz"
