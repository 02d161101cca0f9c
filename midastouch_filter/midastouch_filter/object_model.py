"""What the filter knows of one object: its codebook, its surface, and how it would feel."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

import numpy as np

from midastouch_perception.errors import InputError
from midastouch_perception.mesh import ObjectMesh
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
from .touch import MAP_SCALE, Measurement
from .workers import Workers

if TYPE_CHECKING:
    from midastouch_perception.codebook import Codebook


class ObjectModel:
    """Made once for mesh, codebook and config; holds nothing of what was felt, but for the scores of the last codes.

    Attributes: config; workers; mesh; lookup among the codebook's poses (M, 4, 4); order (M,), of
    the codebook's entries there; surface, the constraint to be at it; measurement model; regions and mode_finder, for
    KLD sampling and clustering; alignment to penetration maps, None if the codebook does not name its sensor or none is
    asked for.
    Raises InputError if the codebook cannot be used.
    """

    def __init__(self, mesh: ObjectMesh, codebook: Codebook, config: FilterConfig, noise: NoiseModel, workers: Workers):
        _require_usable(codebook)
        self.config, self.workers = config, workers
        self._network_id = str(codebook.meta.get("tcn", ""))
        index = ObjectIndex(mesh, codebook, config, workers)
        self.mesh = mesh
        self.order, self.poses, self.lookup = index.order, index.poses, index.lookup
        self.measurement = MeasurementModel(codebook.codes[self.order], codebook.meta, self.lookup, config, workers)
        self.surface = SurfaceConstraint(index.surface, self.lookup.largest_gap, config, workers)
        self.regions = Regions(self.lookup, config.region_radius)
        self.mode_finder = ModeFinder(self.lookup, self.regions, config.mode_radius, config.min_mode_mass, workers)
        self.alignment: PenetrationAlignment | None = None
        sensor = codebook.meta.get("sensor") if config.refinement else None
        if sensor:
            self.alignment = PenetrationAlignment(mesh, SensorModel.load(sensor).scaled(MAP_SCALE), noise)

    def finger_maker(self, gates: Gates) -> Callable[[str], Finger]:
        """A function that makes a finger by its name."""

        def make(name: str) -> Finger:
            model = self.measurement if name == FIRST else self.measurement.for_another_sensor()
            return Finger(name, self.lookup, self.surface, model, self.config, self.workers, gates)

        return make

    def require_same_network(self, touches: Iterable[Measurement]) -> None:
        """Raise InputError if a code comes from another network than the codebook's."""
        for theirs in (touch.network_id for touch in touches):
            if theirs and self._network_id and theirs != self._network_id:
                raise InputError(
                    f"tactile code: from network {theirs}, but the codebook was built with {self._network_id};"
                    " build the codebook with the encoder in use"
                )


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
