"""Watch on a depth that images show: pressed on it should grow, and pulled off it should fall."""

from __future__ import annotations

import numpy as np

from .commanded import Commanded
from .measured import Measured

_AGAINST = 2e-4  # m of depth, changed against the motion


class DepthWatch:
    """Watch on motions into the surface, or off it.

    Parameters
    ----------
    commanded
        Twists of the gel.
    into
        1 for motions into the surface, -1 for those off it.
    least : [m]
        Way from which on a motion counts.
    steep
        It counts while its way is so many times as long as that along the surface.
    """

    def __init__(self, commanded: Commanded, into: float, least: float, steep: float):
        self._commanded, self._into, self._least, self._steep = commanded, into, least, steep
        self._since: Measured | None = None  # image since which the gel has moved so

    def contradicted(self, measured: Measured) -> bool:
        """Take the measurement of an image; return whether the depth has changed against the motion."""
        since = self._since
        if since is not None and since.depth > 0:
            against = self._into * (since.depth - measured.depth)
            way = self._commanded.way(since.stamp, measured.stamp)
            x, y = since.centre
            gone = -self._into * (way[2] + y * way[3] - x * way[4])  # a turn moves what is beside the apex
            if against > 0 and gone > self._steep * np.linalg.norm(way[:2]):
                return against > _AGAINST and gone > self._least
        self._since = measured
        return False
