"""What the filter derives from an object's mesh and codebook alone: made once, kept with the codebook.

To find it again at every start would take longer than all else that a start needs.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh

from .config import FilterConfig
from .lookup import PoseLookup, neighbours_and_links, space_filling_order
from .rough_normals import RoughNormals
from .surface import SurfaceGrid
from .workers import Workers

if TYPE_CHECKING:
    from midastouch_perception.codebook import Codebook

# To be raised when the content of the arrays changes its meaning: others are then made anew.
_PREFIX = "index1_"


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
