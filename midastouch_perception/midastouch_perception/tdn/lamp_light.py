"""Light of the lamps on untouched gel: is it all that an image shows, so that the gel is free?

Lamps that change multiply each colour by a factor that varies slowly over the image. A contact that fills the view has
no outline; but the gel it tilts turns every pattern in the light a little, and no slow factor does that. So a gel is
free if slow factors explain how the image differs from the free ones just before it, down to what these differ by:
noise and compression. A texture may leave the means of all blocks as they are; it shows within them. What lamps, gel
and dirt change in longer times is part of those images.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..sensor_calibration.response import position_terms
from .inputs import BLOCKS, DARKEST, RELATIVE_LEVEL, block_means, reduce_image

_BLOCK_PIXELS = 256  # of compressed images, whose noise is independent from block to block
_CLIPPED = 240.0  # grey levels of a block in which pixels may be at their limit
_LEAST_KNOWN = 0.2  # of the blocks, in each of which all colours are below that
_QUIETEST = 0.8  # of the blocks count: dust and the marks of a touch are in few, a contact that fills the view in all
_UNUSUAL = 1.3  # times what is usually left; fewer than 2 of 1000 images of simulated free gel have more
_MOST = 0.9  # of the blocks have less detail than is compared: dust and marks are in few
_FINEST = 0.05
"""Relative change within blocks from which it may be a texture. Compression leaves less: a JPEG of quality 70 0.03."""
_STEP = 1.0
"""Grey levels that compression leaves of any change, however quiet it is at rest: at most as many in a JPEG of quality
80, in simulation."""
_CAMERA, _ROUNDING = 0.3, 0.03
"""Largest relative deviation of what is usually left from noise that is independent from pixel to pixel, as a camera's
is: other images are compressed. Least such noise [grey levels], that of rounding."""
_INEXACT = 0.01  # of the change: no camera is quite linear
_RATE, _USUAL_RATE = 0.2, 0.05  # with which free gel is learned, and how much it usually differs from that
_PIXELS = 4  # every fourth pixel is enough to measure noise
_FIRST = 1.5  # grey levels, usual before the first image of free gel; another gel's no-contact image leaves more


@dataclass(frozen=True)
class Unexplained:
    """What lamps do not explain in an image. Attributes: usual, whether free gel leaves as much; level, root mean
    square over blocks, in grey levels of a background of 100; fraction (0 ... 1) of the energy of the change; detailed,
    whether the change within blocks is larger than that of free gel, as by a texture."""

    usual: bool
    level: float
    fraction: float
    detailed: bool


class LampLight:
    """Light of the lamps on the gel of one no-contact image, (H, W, 3) uint8 RGB. Attribute: frames of free gel."""

    def __init__(self, background: np.ndarray):
        reduced = reduce_image(background)
        self._background, self._scale = reduced, np.maximum(reduced, DARKEST)
        self._lit = self._seen = block_means(reduced).reshape(-1, 3)
        self._terms = self._lit.T[..., None] * position_terms(*BLOCKS).reshape(-1, 6)
        self._pixels = background[::_PIXELS, ::_PIXELS].astype(np.float32)
        self._usual = self._left = _FIRST
        self._noise = self._usual_noise = self._detail = self._usual_detail = 0.0
        self.frames = 0

    def unexplained(self, image: np.ndarray) -> Unexplained:
        """Return what lamps do not explain in an image (H, W, 3) uint8 RGB."""
        reduced = reduce_image(image)
        seen = block_means(reduced).reshape(-1, 3)
        self._detail = _detail((reduced - self._background) / self._scale)
        last, self._pixels = self._pixels, image[::_PIXELS, ::_PIXELS].astype(np.float32)
        # between neighbours, because there smooth changes cancel; as it is left in the mean of a block of three colours
        self._noise = float(np.diff(self._pixels - last, axis=1).std()) / 2 * np.sqrt(3 / _BLOCK_PIXELS)
        known = seen.max(axis=1) < _CLIPPED
        even = np.median(seen / np.maximum(self._lit, 1.0), axis=0) * self._lit
        change = (seen - even) * known[:, None]
        slow = self._nearest(change, known)
        off = (change - slow) * known[:, None]
        self._seen = np.where(known[:, None], seen, even + slow)
        bright = np.maximum(self._lit, DARKEST) / RELATIVE_LEVEL
        level, energy = (float(np.square(each / bright).mean()) for each in (off, change))
        count = int(_QUIETEST * np.count_nonzero(known))
        if enough := count >= _LEAST_KNOWN * len(known):
            # a median is not led astray by dirt, as the nearest polynomial is
            self._left = min(_quietest(each[known], count) for each in (change, off))
        compressed = abs(self._usual / max(self._usual_noise, _ROUNDING) - 1) > _CAMERA
        most = max(_UNUSUAL * self._usual, compressed * _STEP) + _INEXACT * float(np.abs(seen - self._lit).mean())
        usual = enough and self._left <= most and not self._detailed
        return Unexplained(usual, level**0.5, level / max(energy, 1e-9), self._detailed)

    def learn(self) -> None:
        """Learn from the last image that it is of free gel."""
        self.frames += 1
        rate = max(_USUAL_RATE, 1 / self.frames)
        self._usual += rate * (self._left - self._usual)
        self._usual_noise += rate * (self._noise - self._usual_noise)
        # marks of a contact that has ended are usual from now on
        self._usual_detail += (1.0 if self._detailed else rate) * (self._detail - self._usual_detail)
        self._lit = self._lit + _RATE * (self._seen - self._lit)

    @property
    def _detailed(self) -> bool:
        return self.frames > 0 and self._detail > max(_UNUSUAL * self._usual_detail, _FINEST)

    def _nearest(self, seen: np.ndarray, where: np.ndarray) -> np.ndarray:
        """Return the no-contact image times a quadratic in the position for each colour (N, 3), the nearest to what is
        seen (N, 3) at some of the blocks (N,) bool."""
        some = self._terms[:, where]
        turned = some.transpose(0, 2, 1)
        # the ridge keeps the system regular if few blocks are known
        factors = np.linalg.solve(turned @ some + 1e-3 * np.eye(6), turned @ seen[where].T[..., None])
        return (self._terms @ factors)[..., 0].T


def _detail(change: np.ndarray) -> float:
    """Return how much a relative change (H, W, 3) varies within the blocks of the most detail, root mean square. A lamp
    scales a block as a whole, and its noise by no more."""
    mean = block_means(change)
    varies = (block_means(change * change) - mean * mean) / np.maximum(1.0 + mean, 1.0) ** 2
    return float(np.quantile(varies.sum(axis=2), _MOST)) ** 0.5


def _quietest(off: np.ndarray, count: int) -> float:
    """Return the mean of the `count` smallest sizes [grey levels] of what blocks are off (N, 3)."""
    return float(np.partition(np.linalg.norm(off, axis=1), count - 1)[:count].mean())
