"""Place of a sensor's fixed pattern in an image: where the no-contact image has it, rolled, or turned.

A camera that begins to read in the middle of a line hands out images that are rolled: what leaves them on one side
comes in on the other, and where opposite sides meet there is a seam. Lamps, lens, border and gel make a pattern that no
touch moves: the phase correlation of an image with the no-contact image has a sharp peak at no shift (Kuglin and Hines
1975). If the image was turned, it has that only once it is turned back.
"""

from __future__ import annotations

import cv2
import numpy as np

from midastouch_common.torn_frames import single_seam

from .colour_layout import ORIENTATIONS, driver_fix, turned_since
from .frame_guard import Refusal
from .inputs import reduce_image

_CLEAR = 8.0  # standard deviations of chance, from which a peak of the correlation is no chance
_EVERY = 30  # images out of which one is compared: two a second of a DIGIT, because that takes some ms
_EVERY_REFUSED = 5  # while they are refused
_LINES, _WAYS = ("row", "column"), (("up", "down"), ("left", "right"))
_REPLUG = "plug the sensor in again, or choose another resolution of the driver"
_TURNS = ("upside down", "mirrored left to right", "mirrored top to bottom")


class PatternCheck:
    """Check of one stream that the fixed pattern is where the no-contact image has it."""

    def __init__(self) -> None:
        self._background: np.ndarray | None = None
        self._until_next, self._rolled, self._problem = 0, "", ""

    def refusal(self, image: np.ndarray, background: np.ndarray) -> Refusal | None:
        """Return why not to use the last image that was compared, and those since.

        The first image is compared at once. A no-contact image that is rolled is a reason, too.

        Parameters
        ----------
        image : (H, W, 3) uint8 RGB
            The next image. Do not write into it later.
        background : (H, W, 3) uint8 RGB
            The no-contact image in use.
        """
        if background is not self._background:
            self._background, self._until_next, self._rolled = background, 0, rolled_problem(background)
        if self._until_next == 0:
            self._problem = self._rolled or pattern_problem(image, background)
            self._until_next = _EVERY_REFUSED if self._problem else _EVERY
        self._until_next -= 1
        return Refusal("misplaced_images", self._problem) if self._problem else None


def pattern_problem(image: np.ndarray, background: np.ndarray) -> str:
    """Return the problem and its fix if an image is rolled, turned or swapped against its no-contact image.

    Both are (H, W, 3) uint8 RGB. Empty if it is not, also if the no-contact image is of another sensor.
    """
    if way := _rolled(image, background):
        return _against(f"are rolled by {way}", _REPLUG)
    now, reference = _grey(image), _grey(background)
    in_place = _likeness(now, reference)
    if in_place < _CLEAR:
        turns = {name: _likeness(ORIENTATIONS[name](now), reference) for name in _TURNS}
        best = max(turns, key=turns.__getitem__)
        if turns[best] >= max(_CLEAR, 2 * in_place):
            return _against(f"look {best}", driver_fix(best))
    return turned_since(image, background)


def rolled_problem(background: np.ndarray) -> str:
    """Return the problem and its fix if a no-contact image (H, W, 3) uint8 RGB has a seam from border to border, where
    opposite sides of a rolled image meet; empty if not."""
    if not (seam := single_seam(background)):
        return ""
    return (
        f"the no-contact image has a seam at {_LINES[seam[0]]} {seam[1]}, where opposite sides of a rolled image meet; "
        f"{_REPLUG}, then call capture_background"
    )


def _rolled(image: np.ndarray, background: np.ndarray) -> str:
    """Return by how much an image is rolled and which way; empty unless it is more like the no-contact image if rolled
    back."""
    if not (seam := single_seam(image)):
        return ""
    axis, line = seam
    back = np.roll(image, -line, axis)
    before, after = (float(cv2.absdiff(each, background).mean()) for each in (image, back))
    if after >= before:
        return ""
    length = image.shape[axis]
    by = line if line <= length // 2 else line - length
    return f"{abs(by)} px {_WAYS[axis][by > 0]}"


def _against(how: str, fix: str) -> str:
    return (
        f"the images {how} against the no-contact image; {fix}, or if that is wanted lift the finger and call "
        "capture_background"
    )


def _grey(image: np.ndarray) -> np.ndarray:
    return reduce_image(image).mean(axis=2)


def _likeness(image: np.ndarray, reference: np.ndarray) -> float:
    """Return the phase correlation of two grey images without shift, in standard deviations of that at all shifts; 0 if
    one has a single colour."""
    one, two = (np.fft.rfft2(each - each.mean()) for each in (reference, image))
    product = np.conj(one) * two
    surface = np.fft.irfft2(product / np.maximum(np.abs(product), 1e-6), s=image.shape)
    spread = float(surface.std())
    return float(surface[0, 0]) / spread if spread > 0 else 0.0
