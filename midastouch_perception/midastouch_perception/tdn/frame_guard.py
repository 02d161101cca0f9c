"""Guard of the frames of one sensor: it refuses damaged ones before anything believes them.

It stands in front of the depth stage, not in a driver, because recordings and other drivers have such frames, too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from midastouch_common.torn_frames import TornFrames

from .colour_layout import exposure_problem

_PIXELS = 4  # every fourth pixel is enough to see that an image has changed, or is too dark or bright
_MOST_SATURATED = 0.5  # of an image; a glint of the light on a contact is less
_REPEATS = 60  # equal images in a row that are no chance: a second of a DIGIT, longer than any camera waits
_NOISY = 0.3  # of the values of pixels, changed by a camera's noise from each image to the next


@dataclass(frozen=True)
class Refusal:
    """Reason why a frame is not used. Attributes: kind, under which it is counted; reason with the fix, as text."""

    kind: str
    reason: str


TORN = Refusal(
    "torn_images",
    "the image is torn: its parts are of two frames; if that is frequent, lower the frame rate of the driver or plug "
    "the sensor into another USB port",
)


class FrameGuard:
    """Guard of one stream of images."""

    def __init__(self) -> None:
        self._torn, self._frozen = TornFrames(), _FrozenFrames()

    def refusal(self, image: np.ndarray) -> Refusal | None:
        """Take the next image (H, W, 3) uint8 RGB, and return why not to use it; do not write into it later."""
        pixels = image[::_PIXELS, ::_PIXELS]
        # the network would measure a contact in a dark or bright image
        if problem := exposure_problem(pixels, _MOST_SATURATED):
            return Refusal("bad_images", f"the image is {problem}")
        torn, repeats = self._torn.torn(image), self._frozen.repeats(pixels)
        if repeats >= _REPEATS:
            return Refusal("frozen_images", f"{repeats} equal images in a row: the camera hangs; plug it in again")
        return TORN if torn else None


class _FrozenFrames:
    """Counter of equal images in a row of a camera with noise. A simulator without noise repeats images at rest."""

    def __init__(self) -> None:
        self._last: np.ndarray | None = None
        self._noisy, self._repeats = False, 0

    def repeats(self, pixels: np.ndarray) -> int:
        """Take pixels of the next image; return how many images before it were equal, 0 without noise."""
        if self._last is not None:
            if changed := int(np.count_nonzero(pixels != self._last)):
                self._noisy, self._repeats = changed > _NOISY * pixels.size, 0
            else:
                self._repeats += 1
        self._last = pixels
        return self._repeats if self._noisy else 0
