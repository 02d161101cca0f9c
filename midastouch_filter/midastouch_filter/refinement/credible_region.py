"""How wide a region is that holds the truth as often as it says, over what an alignment says of its own error.

A Gaussian posterior is as wide as its model of the noise has it. Two things tell that the model does not hold, and each
widens the covariance:

* What the map leaves unexplained. How wrong a map is differs from touch to touch, so that the likelihood of a pose is a
  power of its misfit (docs/internals.md). The curvature around its peak falls as m + m0; the covariance grows as it.
* That maps correct the pose in one direction again and again. The innovations of a filter whose model holds are white
  (Mehra 1970). Those of an arm that is late, of an object that was pushed, or of a place nearby are not: what one map
  corrects, the odometry undoes. The pose lags behind, and in directions that maps tell little of it stays off for a
  while once that is over.

How wide the result must be is a split-conformal quantile (Vovk et al. 2005): `midastouch_benchmark/fits/regions.py`.
"""

from __future__ import annotations

import numpy as np

from midastouch_common import se3

from ..core.alignment import Aligned
from ..core.noise_model import NoiseModel

WIDTH, WHITE = 24.5, 0.25  # factor on the covariance, by misfit and bias; what is added to the latter
_MEMORY, _HELD = 15, 50  # maps over which innovations are averaged, and over which a bias is forgotten
_SAID = 0.1  # share of an axis' prior variance below which a map says nothing of it


class CredibleRegion:
    """Follows the alignments of the dominant mode. Args: noise.

    Attribute: bias, squared mean of the last innovations over their predicted variance, times their number, summed over
    the gel's axes: some 3 if they are white and as large as predicted, more if they go on in one direction. The largest
    one is forgotten slowly.
    """

    def __init__(self, noise: NoiseModel):
        self._noise = noise
        self.restart()

    def restart(self) -> None:
        """Nobody knows where the gel is."""
        self._sum, self._number = np.zeros(6), np.ones(6)
        self.bias = 0.0

    def follow(self, pose: np.ndarray, covariance: np.ndarray, posterior: Aligned) -> None:
        """A map turned the prior N(pose (4, 4), covariance (6, 6), own frame) into the posterior."""
        prior = np.diag(covariance)
        predicted = prior - np.diag(posterior.covariance)
        said = predicted > _SAID * prior
        moved = se3.log(se3.inverse(pose) @ posterior.pose)
        keep = 1.0 - 1.0 / _MEMORY
        self._sum, self._number = keep * self._sum, keep * self._number + said
        self._sum[said] += moved[said] / np.sqrt(predicted[said])
        self.bias = max((1.0 - 1.0 / _HELD) * self.bias, float((self._sum**2 / self._number).sum()))

    def widening(self, aligned: Aligned) -> float:
        """Factor on the covariance of a pose that was aligned to this frame's maps."""
        return WIDTH * (1.0 - aligned.fit + self._noise.misfit_floor) * (WHITE + self.bias) ** 2
