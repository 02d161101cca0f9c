"""Model of one object: its codebook, its surface, and the measurements expected there.

Arrays that follow from mesh and codebook alone are made once and kept with the codebook: to compute them at every start
would take longer than the rest of the start.
"""

from __future__ import annotations

import copy
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from pykdtree.kdtree import KDTree
from scipy.spatial import cKDTree

from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_perception.codebook import PRESS
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.symmetry.search import ObjectSymmetry, object_symmetry

from .alignment import PenetrationAlignment
from .config import FilterConfig
from .lookup import PoseLookup, neighbours_and_links, space_filling_order
from .measurement_model import MeasurementModel
from .noise_model import NoiseModel
from .surface import DEAD_DISTANCE, SurfaceGrid
from .touch import MAP_SCALE, Measurement, require_network
from .workers import Workers

if TYPE_CHECKING:
    from midastouch_perception.codebook import Codebook

_SURFACE_SAMPLE = 2048  # points
_POINTS = 10_000
_NEAREST = 4  # points; one of them is on the same side of a thin plate
# Raise this number when the arrays change their meaning: kept ones are then made again.
_PREFIX = "index1_"
_OF_ENTRIES = ("neighbours", "links")


class ObjectModel:
    """Model of one object, made once for mesh, codebook and config. It holds no measurements, so filters can share it.

    A denser codebook of the same object can replace the first (`take`): references to parts of the model
    then have the new entries.
    Attributes: config; workers; mesh; lookup among the codebook's poses; order (M,), numbers in the codebook of the
    look-up's entries; surface, distances to it; normals of it; gap, typical distance [m] of a point of the surface to
    the nearest one that a codebook pose touches; measurement, model of codes; symmetry of the object; alignment to
    penetration maps, None if the codebook does not name its sensor, or without `refinement`.
    Raises InputError if the codebook cannot be used.
    """

    def __init__(self, mesh: ObjectMesh, codebook: Codebook, config: FilterConfig, noise: NoiseModel, workers: Workers):
        _require_usable(codebook)
        self.mesh, self.config, self.workers = mesh, config, workers
        self.symmetry = symmetry_of(mesh, codebook)
        self._network_id = str(codebook.meta.get("tcn", ""))
        kept = codebook.derived
        fits = float(kept.get(_PREFIX + "band", np.nan)) == DEAD_DISTANCE  # otherwise other code made it
        with _named(codebook):
            self.surface = SurfaceGrid(mesh, DEAD_DISTANCE, workers, kept.get(_PREFIX + "distances") if fits else None)
            self.normals = RoughNormals(mesh, kept.get(_PREFIX + "normals"))
        self._make_entries(codebook)
        self.alignment: PenetrationAlignment | None = None
        if config.refinement and codebook.meta.get("sensor"):
            sensor = SensorModel.of_codebook(codebook.meta).scaled(MAP_SCALE)
            self.alignment = PenetrationAlignment(mesh, sensor, noise)

    def _make_entries(self, codebook: Codebook) -> None:
        self.order = space_filling_order(codebook.poses)
        poses = codebook.poses[self.order]
        with _named(codebook):
            self.lookup = PoseLookup(poses, self.workers, _graph(codebook.derived, len(poses)))
        self.measurement = MeasurementModel(codebook.codes[self.order], codebook.meta, self.config, self.workers)
        self.gap = _gap(self.mesh, poses)

    def with_codebook(self, codebook: Codebook) -> ObjectModel:
        """Return a model of the same object with another codebook, for `take`; a filter may run meanwhile."""
        _require_usable(codebook)
        other = copy.copy(self)
        other._make_entries(codebook)
        return other

    def take(self, other: ObjectModel) -> None:
        """Replace the entries by those of another model of the same object."""
        for name in ("lookup", "measurement"):
            vars(getattr(self, name)).update(vars(getattr(other, name)))
        self.order, self.gap = other.order, other.gap

    @property
    def density(self) -> str:
        """Density of the codebook, and the precision that it allows, as a phrase."""
        size, spacing, gap = len(self.lookup), 1e3 * self.lookup.spacing, 1e3 * self.gap
        return f"codebook of {size:,} poses, {spacing:.1f} mm apart (codes alone locate the gel to {gap:.1f} mm)"

    def require_same_network(self, touches: Iterable[Measurement]) -> None:
        """Raise InputError if a code comes from another network than the codebook's."""
        require_network(touches, self._network_id)


def symmetry_of(mesh: ObjectMesh, codebook: Codebook) -> ObjectSymmetry:
    """Return the symmetry that the codebook states, otherwise a computed one; none if it does not name its sensor."""
    if codebook.symmetry is not None:
        return codebook.symmetry
    if not codebook.meta.get("sensor"):
        return ObjectSymmetry()
    return object_symmetry(mesh, SensorModel.of_codebook(codebook.meta), codebook.poses)


def _gap(mesh: ObjectMesh, poses: np.ndarray) -> float:
    """Return the median distance [m] of points of the surface to the nearest one touched by poses (M, 4, 4)."""
    points = mesh.sample_surface(_SURFACE_SAMPLE, np.random.default_rng(0))[0]
    touched = poses[:, :3, 3] + PRESS * poses[:, :3, 2]
    return float(np.median(KDTree(touched).query(points)[0]))


def _require_usable(codebook: Codebook) -> None:
    """Raise InputError unless the codebook holds finite poses and as many codes."""
    poses, codes = np.shape(codebook.poses), np.shape(codebook.codes)
    if poses[1:] != (4, 4) or not poses[0]:
        raise InputError(f"codebook: poses of shape {poses}, not (entries, 4, 4); build it again")
    if len(codes) != 2 or not codes[1]:
        raise InputError(f"codebook: codes of shape {codes}, not (entries, length); build it again")
    if codes[0] != poses[0]:
        raise InputError(f"codebook: {codes[0]} codes for {poses[0]} poses; build it again")
    if not np.isfinite(codebook.poses).all():
        raise InputError("codebook: poses are not finite; build it again with `midastouch build-codebook`")


class RoughNormals:
    """Normals of a surface, taken from the nearest of 10,000 points; these are sampled when they are first needed.

    Args: mesh; kept, `values` that were made for this mesh before, if there are any.
    """

    def __init__(self, mesh: ObjectMesh, kept: np.ndarray | None = None):
        if kept is not None and kept.shape != (_POINTS, 6):
            raise InputError(f"normals {kept.shape} are not of {_POINTS} points")
        self._mesh, self._kept = mesh, kept

    @cached_property
    def values(self) -> np.ndarray:
        """Points [m] and their outward normals, (10000, 6) float32."""
        if self._kept is not None:
            return self._kept
        points = self._mesh.sample_surface(_POINTS, np.random.default_rng(0))[0]
        return np.concatenate([points, self._mesh.smooth_normals(points)], axis=1).astype(np.float32)

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.values[:, :3])  # without threads: queries are small

    def at(self, points: np.ndarray, faces: np.ndarray) -> np.ndarray:
        """Return outward normals (N, 3) at surface points (N, 3), on the side that the mesh's `faces` (N,) look to."""
        near = self.values[self._tree.query(points, k=_NEAREST)[1], 3:].astype(float)
        facing = np.einsum("nkj,nj->nk", near, self._mesh.face_normals[faces]) > 0
        return near[np.arange(len(near)), np.argmax(facing, axis=1)]


@contextmanager
def _named(codebook: Codebook) -> Iterator[None]:
    """Turn errors in kept arrays into InputErrors that name their file."""
    try:
        yield
    except ValueError as error:
        raise InputError(f"{codebook.source}: {error}; build it again with `midastouch build-codebook`") from error


def _graph(kept: Mapping[str, np.ndarray], entries: int) -> tuple[np.ndarray, np.ndarray] | None:
    names = [_PREFIX + name for name in _OF_ENTRIES]
    if entries < 2 or not all(name in kept for name in names):
        return None
    neighbours, links = (np.ascontiguousarray(kept[name], np.int32) for name in names)
    if neighbours.ndim != 2 or links.ndim != 2 or not neighbours.shape[1] or not links.shape[1]:
        raise ValueError("neighbours and links are not tables")
    return neighbours, links


def derived_arrays(mesh: ObjectMesh, codebook: Codebook) -> dict[str, np.ndarray]:
    """Return the arrays to keep with a codebook; none for a codebook too small to be used."""
    if len(codebook.poses) < 2:
        return {}
    graph = neighbours_and_links(codebook.poses[space_filling_order(codebook.poses)])
    arrays = {
        **dict(zip(_OF_ENTRIES, graph, strict=True)),
        "band": np.array(DEAD_DISTANCE),
        "distances": SurfaceGrid(mesh, DEAD_DISTANCE, Workers(1)).values,
        "normals": RoughNormals(mesh).values,
    }
    return {_PREFIX + name: array for name, array in arrays.items()}


def of_surface(kept: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return those `derived_arrays` that depend on the mesh alone, so that they hold for any part of the codebook."""
    of_entries = [_PREFIX + name for name in _OF_ENTRIES]
    return {
        name: np.array(array) for name, array in kept.items() if name.startswith(_PREFIX) and name not in of_entries
    }
