"""What the filter knows of one object: its codebook, its surface, and how it would feel."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

import numpy as np
from pykdtree.kdtree import KDTree

from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_perception.codebook import PRESS
from midastouch_perception.sensor_model import SensorModel

from .alignment import PenetrationAlignment
from .config import FilterConfig
from .fingers import FIRST, Finger
from .gates import Gates
from .measurement_model import MeasurementModel
from .modes import ModeFinder
from .noise_model import NoiseModel
from .object_index import ObjectIndex
from .regions import Regions
from .surface import SurfaceConstraint
from .touch import MAP_SCALE, Measurement, require_network
from .workers import Workers

if TYPE_CHECKING:
    from midastouch_perception.codebook import Codebook

_SURFACE_SAMPLE = 2048  # points


class ObjectModel:
    """Made once for mesh, codebook and config; holds nothing of what was felt, but for the scores of the last codes.

    A denser codebook of the same object can take the place of the first: whoever refers to a part of the model then has
    the new entries.
    Attributes: config; workers; mesh; lookup among the codebook's poses; order (M,), of the codebook's entries there;
    surface, the constraint to be at it; normals of it; gap, typical distance [m] of a point of the surface to the
    nearest one that a codebook pose touches; measurement model; regions and mode_finder, for KLD sampling and
    clustering; alignment to penetration maps, None if the codebook does not name its sensor or none is asked for.
    Raises InputError if the codebook cannot be used.
    """

    def __init__(self, mesh: ObjectMesh, codebook: Codebook, config: FilterConfig, noise: NoiseModel, workers: Workers):
        _require_usable(codebook)
        self.mesh, self.config, self.workers = mesh, config, workers
        self._network_id = str(codebook.meta.get("tcn", ""))
        self._make_entries(codebook, ObjectIndex(mesh, codebook, config, workers))
        self.alignment: PenetrationAlignment | None = None
        if config.refinement and codebook.meta.get("sensor"):
            sensor = SensorModel.of_codebook(codebook.meta).scaled(MAP_SCALE)
            self.alignment = PenetrationAlignment(mesh, sensor, noise)

    def _make_entries(self, codebook: Codebook, index: ObjectIndex) -> None:
        config, workers = self.config, self.workers
        self._index, self.order, self.lookup, self.normals = index, index.order, index.lookup, index.normals
        self.measurement = MeasurementModel(codebook.codes[self.order], codebook.meta, config, workers)
        self.surface = SurfaceConstraint(index.surface, self.lookup.largest_gap, config, workers)
        self.gap = _gap(self.mesh, self.lookup.poses)
        self.regions = Regions(self.lookup, config.region_radius)
        self.mode_finder = ModeFinder(self.lookup, self.regions, config.mode_radius, config.min_mode_mass, workers)

    def with_codebook(self, codebook: Codebook) -> ObjectModel:
        """A model of the same object by another codebook, for `take`. It may be made beside a running filter."""
        _require_usable(codebook)
        other = copy.copy(self)
        other._make_entries(codebook, ObjectIndex(self.mesh, codebook, self.config, self.workers, self._index))
        return other

    def take(self, other: ObjectModel) -> None:
        """Have the entries of another model of the same object in place of one's own."""
        for name in ("lookup", "measurement", "surface", "regions", "mode_finder"):
            vars(getattr(self, name)).update(vars(getattr(other, name)))
        self.order, self.gap = other.order, other.gap

    @property
    def density(self) -> str:
        """How dense the codebook is, and what that allows, in words."""
        size, spacing, gap = len(self.lookup), 1e3 * self.lookup.spacing, 1e3 * self.gap
        return f"codebook of {size:,} poses, {spacing:.1f} mm apart (codes alone tell a place to {gap:.1f} mm)"

    def measurement_of(self, finger: str) -> MeasurementModel:
        """The model that keeps the scores of a finger's codes, by its name."""
        return self.measurement if finger == FIRST else self.measurement.for_another_sensor()

    def finger_maker(self, gates: Gates) -> Callable[[str], Finger]:
        """A function that makes a finger by its name."""

        def make(name: str) -> Finger:
            model = self.measurement_of(name)
            return Finger(name, self.lookup, self.surface, model, self.config, self.workers, gates)

        return make

    def require_same_network(self, touches: Iterable[Measurement]) -> None:
        """Raise InputError if a code comes from another network than the codebook's."""
        require_network(touches, self._network_id)


def _gap(mesh: ObjectMesh, poses: np.ndarray) -> float:
    """Median distance [m] of points of the surface to the nearest one touched by poses (M, 4, 4)."""
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
