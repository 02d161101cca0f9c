"""Fine texture of a gel, which shows whether two images are of the same gel and whether it has moved between them.

Paint, grains and dust make a pattern in every gel that does not change with brightness, light or a touch elsewhere. It
identifies the gel as the pattern of its pixels identifies a camera (Lukas, Fridrich and Goljan 2006). Images of one gel
correlate at the shift at which they coincide; images of two gels do so at none. The correlations at all other shifts
show what is chance, so a likeness is given in standard deviations.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from .sensor_model import SensorModel

_FINEST, _COARSEST, _CONTRAST = 1.5, 4.0, 8.0  # px: finer is noise, coarser light and shapes; scale of local contrast
_BORDER = 8  # px that the filters spoil
_LEAST_CONTRAST = 0.1  # grey levels: a smooth image in whole grey levels has 0.07, real gels have 0.2 or more
_LEAST_COVERED = 0.5  # of an image that must have that much contrast; otherwise the gel has no texture
_MOST, _STEPS = 3.0, 40  # largest value of a pixel, in units of the contrast around it; integer steps per unit
_FARTHEST = 8  # px by which a gel may have moved
_BESIDE = 20  # px of shift within which the pattern may correlate with itself
_NEAR = 21  # px of a map: size of the dilation that covers the gel around a contact
_REGION = 40  # px, side of a region whose texture is compared by itself
_FAINTEST = 6.0  # standard deviations, median over regions; a fainter texture cannot judge single regions
_LOST = 1 / 3  # of the median: less is another texture
_LEAST_WORN = 0.005  # of the image
_OF_ANOTHER_GEL = (
    "the no-contact image is of another gel: the fine texture of the images is not found in it; lift the finger and "
    "call capture_background, and if the gel was changed, run midastouch calibrate again"
)
_ELSEWHERE = [(down, right) for down in (-60, 0, 60) for right in (-60, 0, 60) if down or right]
SAME_GEL = 6.0
"""Standard deviations from which two images are of the same gel: one normal number in a billion is as large, and there
are some hundred shifts."""
CLEAR = 2 * SAME_GEL
"""Standard deviations from which a gel's texture is clear enough to recognise the gel by it."""
MOVED = 2.0
"""Shift [px] from which a gel counts as moved."""


@dataclass(frozen=True)
class Likeness:
    """Likeness of two textures.

    Attributes: sigmas, their correlation in standard deviations of chance; shift of the second against the first, in
    pixels (right, down)."""

    sigmas: float
    shift: tuple[int, int]

    @property
    def same(self) -> bool:
        """True if both are of the same gel."""
        return self.sigmas >= SAME_GEL

    @property
    def moved(self) -> float:
        """Length of the shift [px]."""
        return float(np.hypot(*self.shift))


def gel_texture(image: np.ndarray, touched: np.ndarray | None = None) -> np.ndarray:
    """Return the texture (H - 16, W - 16) int8 of an image (H, W, 3) uint8, in 1/40 of the contrast around each pixel.

    It is 0 where the gel is touched, and where it has no texture. touched: (h, w) bool, of any resolution.
    """
    grey = image.astype(np.float32).mean(axis=2)
    band = cv2.GaussianBlur(grey, (0, 0), _FINEST) - cv2.GaussianBlur(grey, (0, 0), _COARSEST)
    contrast = np.sqrt(cv2.GaussianBlur(band * band, (0, 0), _CONTRAST))
    texture = np.clip(band / np.maximum(contrast, _LEAST_CONTRAST), -_MOST, _MOST)
    smooth = contrast < _LEAST_CONTRAST
    texture[smooth | (smooth.mean() > 1 - _LEAST_COVERED)] = 0.0
    if touched is not None:
        touched = cv2.resize(touched.astype(np.uint8), grey.shape[::-1], interpolation=cv2.INTER_NEAREST)
        texture[touched > 0] = 0.0
    return np.rint(_STEPS * texture[_BORDER:-_BORDER, _BORDER:-_BORDER]).astype(np.int8)


def likeness(first: np.ndarray, second: np.ndarray) -> Likeness:
    """Return the likeness of two textures, or sums of textures, of the same size; 0 sigmas if one is empty."""
    one, two = (np.fft.rfft2(each - each.mean()) for each in (first, second))
    surface = np.fft.irfft2(np.conj(one) * two, s=first.shape)
    surface = np.roll(surface, (_BESIDE, _BESIDE), axis=(0, 1))
    reach = slice(_BESIDE - _FARTHEST, _BESIDE + _FARTHEST + 1)
    near = surface[reach, reach]
    spread = float(surface[2 * _BESIDE :].std())
    if not spread > 0:
        return Likeness(0.0, (0, 0))
    down, right = np.unravel_index(near.argmax(), near.shape)
    return Likeness(float(near[down, right]) / spread, (int(right) - _FARTHEST, int(down) - _FARTHEST))


def worn_gel(first: np.ndarray, second: np.ndarray, shift: tuple[int, int]) -> np.ndarray:
    """Return the pixels (H, W) bool where the texture of a gel has changed from `first` to `second`, both (H, W).

    There the gel is dirty, or its paint is gone. shift: of the second against the first [px]. Textures that are too
    faint to judge single regions give no pixels.
    """
    first, second = first.astype(np.float32), np.roll(second, (-shift[1], -shift[0]), axis=(0, 1)).astype(np.float32)
    known = cv2.blur((second != 0).astype(np.float32), (_REGION, _REGION)) > 0.5
    chance = [_correlation(first, np.roll(second, far, axis=(0, 1)))[known] for far in _ELSEWHERE]
    sigmas = _correlation(first, second) / max(float(np.std(chance)), 1e-9)
    typical = float(np.median(sigmas[known])) if known.any() else 0.0
    return known & (sigmas < _LOST * typical) if typical >= _FAINTEST else np.zeros_like(known)


def _correlation(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return the correlation (H, W) of two textures (H, W) in the region around each pixel."""
    pairs = (first, second), (first, first), (second, second)
    both, one, two = (cv2.blur(a * b, (_REGION, _REGION)) for a, b in pairs)
    return both / np.sqrt(one * two + 1e-9)


class GelCheck:
    """Check that a sensor's images show the gel of its no-contact image, at the same place.

    Two sums, each over every other image looked at, show by their likeness how well the gel can be recognised; both
    together are compared with the no-contact image.

    Attributes: sigmas, likeness at the last verdict, None before the first; problem, reason why the no-contact image is
    wrong, "" if it is right.

    Parameters
    ----------
    sensor
        At image resolution.
    every
        Number of images out of which one is looked at.
    window
        Number of images looked at for one verdict.
    """

    def __init__(self, sensor: SensorModel, every: int = 20, window: int = 16):
        self._pixel = sensor.pixel_size
        self._every, self._window = every, window
        self.reset()

    def reset(self) -> None:
        """Forget all images, because the no-contact image has changed."""
        self._images = self._looked_at = 0
        self._sums: list[Any] = [0.0, 0.0]
        self.sigmas: float | None = None
        self.problem = ""

    @property
    def another(self) -> bool:
        """True while the images are of another gel than the no-contact image."""
        return self.problem == _OF_ANOTHER_GEL

    @property
    def values(self) -> dict[str, str]:
        """Values for the diagnostics."""
        return {"gel_likeness": "" if self.sigmas is None else f"{self.sigmas:.0f}"}

    def observe(self, image: np.ndarray, background: np.ndarray, penetration: np.ndarray) -> None:
        """Take an image.

        Parameters
        ----------
        image, background : (H, W, 3) uint8
            The image, and the no-contact image.
        penetration : (h, w) measured in the image [m]
        """
        self._images += 1
        if (self._images - 1) % self._every:
            return
        touched = cv2.dilate((penetration > 0).astype(np.uint8), np.ones((_NEAR, _NEAR), np.uint8))
        self._sums[self._looked_at % 2] = self._sums[self._looked_at % 2] + gel_texture(image, touched)
        self._looked_at += 1
        if self._looked_at == self._window:
            self._judge(background)
            self._looked_at, self._sums = 0, [0.0, 0.0]

    def _judge(self, background: np.ndarray) -> None:
        (first, second), reference = self._sums, gel_texture(background)
        if not reference.any():  # e.g. of a simulator
            return
        found = likeness(reference, first + second)
        self.sigmas = found.sigmas
        if not found.same:
            self.problem = _OF_ANOTHER_GEL if likeness(first, second).sigmas >= CLEAR else ""
        elif found.moved >= MOVED:
            self.problem = (
                f"the gel has moved by {1e3 * self._pixel * found.moved:.2f} mm since the no-contact image; see that "
                "it is fixed, lift the finger and call capture_background"
            )
        else:
            self.problem = self._worn(worn_gel(reference, first + second, found.shift))

    def _worn(self, worn: np.ndarray) -> str:
        """Return the problem with a gel that is worn at these pixels (H, W) bool; empty if they are very few."""
        if worn.mean() <= _LEAST_WORN:
            return ""
        down, right = 1e3 * self._pixel * (np.argwhere(worn).mean(axis=0) + _BORDER)
        return (
            f"the gel is dirty or worn on {100 * worn.mean():.0f} % of the image, {right:.0f} mm from its left and "
            f"{down:.0f} mm from its top: its texture has changed there since the no-contact image; clean it, and call "
            "capture_background, or change the gel and calibrate"
        )
