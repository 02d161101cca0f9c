"""Scale of the mesh: the path over it against the path by odometry."""

from __future__ import annotations

import numpy as np

_SHORT = 10e-3  # m, RMS of the positions; on a shorter path, most of what the paths differ by is the pose's settling


class MeshScale:
    """Similarity that maps the path by odometry to the path on the mesh, while the pose is known.

    It is the least squares fit of Umeyama (1991, equations 40 to 42), from sums over the positions of the gel.
    """

    def __init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """Forget the path."""
        self._count, self._sum, self._products = 0, np.zeros(6), np.zeros((6, 6))

    def add(self, by_odometry: np.ndarray, on_mesh: np.ndarray) -> None:
        """Add a position of the gel: since the start by odometry, and in the frame of the object, both (3,) m."""
        pair = np.concatenate([by_odometry, on_mesh])
        self._count, self._sum = self._count + 1, self._sum + pair
        self._products += np.outer(pair, pair)

    def fault(self, region: float) -> str:
        """Return how much larger or smaller than the object the mesh is, "" if that cannot be told.

        It can if the paths differ by more than what is published as the pose's uncertainty, `region` [m], and more by
        their scale than otherwise.
        """
        if not self._count:
            return ""
        mean = self._sum / self._count
        covariance = self._products / self._count - np.outer(mean, mean)
        left, values, right = np.linalg.svd(covariance[3:, :3])
        values[2] *= np.sign(np.linalg.det(left @ right))
        extent, shared = np.trace(covariance[:3, :3]), values.sum()
        if extent < _SHORT**2:
            return ""
        excess = shared / extent - 1.0
        unexplained = np.trace(covariance[3:, 3:]) - shared**2 / extent
        if excess**2 * extent < max(region**2, unexplained) or abs(excess) < 0.01:
            return ""
        return f"the mesh seems {abs(excess):.0%} too {'large' if excess > 0 else 'small'}"
