"""What the filter knows of one object: its codebook, its surface, and what it would measure there.

What follows from mesh and codebook alone is made once and kept with the codebook: to find it again at every start would
take longer than all else that a start needs.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

import numpy as np
from pykdtree.kdtree import KDTree
from scipy.spatial import cKDTree

from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_perception.codebook import PRESS
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.symmetry.group import Symmetry
from midastouch_perception.symmetry.search import ObjectSymmetry, object_symmetry

from .alignment import PenetrationAlignment
from .config import FilterConfig
from .fingers import FIRST, Finger
from .gates import Gates
from .lookup import PoseLookup, neighbours_and_links, space_filling_order
from .measurement_model import MeasurementModel
from .modes import ModeFinder, Regions
from .noise_model import NoiseModel
from .surface import SurfaceConstraint, SurfaceGrid
from .touch import MAP_SCALE, Measurement, require_network
from .workers import Workers

if TYPE_CHECKING:
    from midastouch_perception.codebook import Codebook

_SURFACE_SAMPLE = 2048  # points
_TURNS, _SYMMETRY_SAMPLE = 180, 64  # about a free axis; poses whose equivalents are counted
_POINTS = 10_000
_NEAREST = 4  # points; one of them is on the same side of a thin plate
# To be raised when the content of the arrays changes its meaning: others are then made anew.
_PREFIX = "index1_"


class ObjectModel:
    """Made once for mesh, codebook and config; holds nothing of what was measured, but for the scores of the last
    codes.

    A denser codebook of the same object can replace the first: references to parts of the model
    then have the new entries.
    Attributes: config; workers; mesh; lookup among the codebook's poses; order (M,), of the codebook's entries there;
    surface, the constraint to be at it; normals of it; gap, typical distance [m] of a point of the surface to the
    nearest one that a codebook pose touches; measurement model; regions and mode_finder, for KLD sampling and
    clustering; symmetry of the object; n_poses, number of poses that codes can tell apart, modulo it; alignment to
    penetration maps, None if the codebook does not name its sensor or none is asked for.
    Raises InputError if the codebook cannot be used.
    """

    def __init__(self, mesh: ObjectMesh, codebook: Codebook, config: FilterConfig, noise: NoiseModel, workers: Workers):
        _require_usable(codebook)
        self.mesh, self.config, self.workers = mesh, config, workers
        self.symmetry = symmetry_of(mesh, codebook)
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
        self.n_poses = len(self.regions) / _copies(self.symmetry.exact, self.lookup, self.regions)
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
        self.order, self.gap, self.n_poses = other.order, other.gap, other.n_poses

    @property
    def density(self) -> str:
        """How dense the codebook is, and what that allows, in words."""
        size, spacing, gap = len(self.lookup), 1e3 * self.lookup.spacing, 1e3 * self.gap
        return f"codebook of {size:,} poses, {spacing:.1f} mm apart (codes alone locate the gel to {gap:.1f} mm)"

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


def symmetry_of(mesh: ObjectMesh, codebook: Codebook) -> ObjectSymmetry:
    """The object's symmetry: what the codebook tells of it, or what is found if it tells nothing but its sensor."""
    if codebook.symmetry is not None:
        return codebook.symmetry
    if not codebook.meta.get("sensor"):
        return ObjectSymmetry()
    return object_symmetry(mesh, SensorModel.of_codebook(codebook.meta), codebook.poses)


def _copies(symmetry: Symmetry, lookup: PoseLookup, regions: Regions) -> float:
    """In how many regions a pose and its equivalents lie, on average."""
    if symmetry.trivial:
        return 1.0
    motions = symmetry.turned(_TURNS)
    some = lookup.poses[:: -(-len(lookup) // _SYMMETRY_SAMPLE)]
    of_images = regions.of_entry[lookup.exact((motions[:, None] @ some).reshape(-1, 4, 4))]
    return float(np.mean([len(set(column)) for column in of_images.reshape(len(motions), -1).T]))


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


class RoughNormals:
    """Those of the nearest one of 10,000 points of the surface.

    Attributes: values (10000, 6) float32, the points [m] and their outward normals.
    """

    def __init__(self, mesh: ObjectMesh, values: np.ndarray | None = None):
        """`values` of earlier ones of this mesh, if there are any."""
        self._mesh = mesh
        if values is None:
            points = mesh.sample_surface(_POINTS, np.random.default_rng(0))[0]
            values = np.concatenate([points, mesh.smooth_normals(points)], axis=1).astype(np.float32)
        elif values.shape != (_POINTS, 6):
            raise InputError(f"normals {values.shape} are not of {_POINTS} points")
        self.values = values
        self._tree = cKDTree(values[:, :3])  # without threads: queries are small

    def at(self, points: np.ndarray, faces: np.ndarray) -> np.ndarray:
        """Outward normals (N, 3) at surface points (N, 3), on the side to which the mesh's `faces` (N,) look."""
        near = self.values[self._tree.query(points, k=_NEAREST)[1], 3:].astype(float)
        facing = np.einsum("nkj,nj->nk", near, self._mesh.face_normals[faces]) > 0
        return near[np.arange(len(near)), np.argmax(facing, axis=1)]


class ObjectIndex:
    """Look-up among the codebook's poses, distances to the surface of one object and its normals.

    Args: mesh; codebook, whose `derived` arrays are used where they fit this configuration; config; workers; known,
    another index of the same object. Attributes: order (M,), of the codebook's entries in `lookup`; lookup; surface;
    normals.
    Raises InputError if the derived arrays are broken.
    """

    def __init__(
        self,
        mesh: ObjectMesh,
        codebook: Codebook,
        config: FilterConfig,
        workers: Workers,
        known: ObjectIndex | None = None,
    ):
        kept = codebook.derived
        self.order = space_filling_order(codebook.poses)
        poses = np.asarray(codebook.poses, float)[self.order]
        band = _band(config)
        # limits of another configuration ask for another grid
        fits = float(kept.get(_PREFIX + "band", np.nan)) == band
        try:
            self.lookup = PoseLookup(poses, workers, _graph(kept, len(poses)))
            if known is not None:
                self.surface, self.normals = known.surface, known.normals
            else:
                self.surface = SurfaceGrid(mesh, band, kept.get(_PREFIX + "distances") if fits else None)
                self.normals = RoughNormals(mesh, kept.get(_PREFIX + "normals"))
        except ValueError as error:
            raise InputError(f"{codebook.source}: {error}; build it again with `midastouch build-codebook`") from error


def _graph(kept: dict[str, np.ndarray], entries: int) -> tuple[np.ndarray, np.ndarray] | None:
    names = [_PREFIX + name for name in ("neighbours", "links")]
    if entries < 2 or not all(name in kept for name in names):
        return None
    neighbours, links = (np.ascontiguousarray(kept[name], np.int32) for name in names)
    if neighbours.ndim != 2 or links.ndim != 2 or not neighbours.shape[1] or not links.shape[1]:
        raise ValueError("neighbours and links are not tables")
    return neighbours, links


def derived_arrays(mesh: ObjectMesh, codebook: Codebook) -> dict[str, np.ndarray]:
    """What to keep with a codebook, for the default configuration; nothing for a codebook too small to be used."""
    if len(codebook.poses) < 2:
        return {}
    band = _band(FilterConfig())
    neighbours, links = neighbours_and_links(codebook.poses[space_filling_order(codebook.poses)])
    arrays = {
        "neighbours": neighbours,
        "links": links,
        "band": np.array(band),
        "distances": SurfaceGrid(mesh, band).values,
        "normals": RoughNormals(mesh).values,
    }
    return {_PREFIX + name: array for name, array in arrays.items()}


def _band(config: FilterConfig) -> float:
    """How far from the surface [m] a configuration asks for distances."""
    return max(config.dead_distance, config.max_penetration, config.max_hover)
