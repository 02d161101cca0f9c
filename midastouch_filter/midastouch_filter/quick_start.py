"""An object that comes without a codebook: a coarse one is built on the spot."""

from __future__ import annotations

import os
from pathlib import Path

from midastouch_perception.codebook import Codebook
from midastouch_perception.mesh import ObjectMesh
from midastouch_perception.sensor_model import SensorModel

from .config import FilterConfig
from .localiser import LoadedObject, object_of

SIZE = 5_000
"""Poses, a tenth of those that `midastouch build-codebook` takes: built in seconds."""


def build_object(mesh_path: Path, network: str, sensor_model: str, config: FilterConfig, seed: int) -> LoadedObject:
    """The filter on a mesh and a codebook of `SIZE` poses that is built now.

    network, sensor_model: names or paths, as the nodes `tcn` and `tdn` take them. Raises InputError for what they do
    not name, a mesh that cannot be used, and one without reachable surface.
    """
    mesh, codebook = coarse_codebook(mesh_path, network, sensor_model, config)
    return object_of(mesh, codebook, config, seed)


def coarse_codebook(
    mesh_path: Path, network: str, sensor_model: str, config: FilterConfig
) -> tuple[ObjectMesh, Codebook]:
    """A mesh and a codebook of `SIZE` poses that is built now; arguments and errors as of `build_object`."""
    # the runtime of networks is needed for this alone
    from midastouch_perception.codebook_build import CodebookBuild
    from midastouch_perception.tcn import load_tcn

    mesh, sensor = ObjectMesh.load(mesh_path), SensorModel.load(sensor_model)
    jobs = config.threads or len(os.sched_getaffinity(0))
    return mesh, CodebookBuild(mesh, load_tcn(network, sensor), sensor, SIZE).run(jobs)
