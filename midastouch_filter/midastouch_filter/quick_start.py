"""An object that comes without a codebook: a coarse one is built on the spot, denser ones while the filter runs."""

from __future__ import annotations

import dataclasses
import os
from pathlib import Path
from typing import TYPE_CHECKING

from midastouch_common.mesh import ObjectMesh
from midastouch_perception.codebook import Codebook
from midastouch_perception.sensor_model import SensorModel

from .core.config import FilterConfig
from .growth import Growth, levels
from .localiser import LoadedObject, object_of

if TYPE_CHECKING:
    from midastouch_perception.tcn import TactileCodeNet

SIZE = 5_000
"""Poses, a tenth of those that `midastouch build-codebook` takes: built in seconds."""


def build_object(mesh_path: Path, network: str, sensor_model: str, config: FilterConfig, seed: int) -> LoadedObject:
    """The filter on a mesh and a codebook of `SIZE` poses that is built now; it grows once it is localised on.

    network, sensor_model: names or paths, as the nodes `tcn` and `tdn` take them. Raises InputError for what they do
    not name, a mesh that cannot be used, and one without reachable surface.
    """
    mesh, tcn, sensor, codebook = _built(mesh_path, network, sensor_model, config)
    loaded = object_of(mesh, codebook, config, seed)
    growth = Growth(lambda pause: levels(mesh, tcn, sensor, pause), loaded.filter.object.with_codebook)
    return dataclasses.replace(loaded, growth=growth)


def coarse_codebook(
    mesh_path: Path, network: str, sensor_model: str, config: FilterConfig
) -> tuple[ObjectMesh, Codebook]:
    """A mesh and a codebook of `SIZE` poses that is built now; arguments and errors as of `build_object`."""
    mesh, _, _, codebook = _built(mesh_path, network, sensor_model, config)
    return mesh, codebook


def _built(
    mesh_path: Path, network: str, sensor_model: str, config: FilterConfig
) -> tuple[ObjectMesh, TactileCodeNet, SensorModel, Codebook]:
    # the runtime of networks is needed for this alone
    from midastouch_perception.codebook_build import CodebookBuild
    from midastouch_perception.tcn import load_tcn

    mesh, sensor = ObjectMesh.load(mesh_path), SensorModel.load(sensor_model)
    tcn, jobs = load_tcn(network, sensor), config.threads or len(os.sched_getaffinity(0))
    return mesh, tcn, sensor, CodebookBuild(mesh, tcn, sensor, SIZE).run(jobs)
