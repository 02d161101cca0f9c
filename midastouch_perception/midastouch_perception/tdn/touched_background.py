"""Does the no-contact image show a touch? What the images have in common tells.

A touch in the no-contact image is in every difference, wherever the finger is, and hides what is felt there. The
median of images that are touched in different places is the untouched gel; the no-contact image must not look like
that with something pressed onto it.
"""

from __future__ import annotations

import numpy as np

from .background import estimate_background, shows_contact
from .depth_net import DepthNet


class TouchedBackground:
    """Watches the images of one sensor that differ from its no-contact image.

    Args: tdn; every, how many such images pass for one that is kept, at first: twice as many after each window, as a
    no-contact image does not change by itself; window, how many of those count, at least a third of which must have
    come before anything is said.
    Attribute: problem, that the no-contact image shows a touch, and the mend; empty if it does not.
    """

    def __init__(self, tdn: DepthNet, every: int = 5, window: int = 15):
        self._tdn, self._every, self._window = tdn, every, window
        self._step = max(1, window // 3)
        self.reset()

    def reset(self) -> None:
        """Forget what was seen: the no-contact image is another one."""
        self._start(None)

    def observe(self, image: np.ndarray, background: np.ndarray) -> None:
        """One image and the no-contact image in use, both (320, 240, 3) uint8 RGB; neither is written into later."""
        if background is not self._background:
            self._start(background)
        self._frames += 1
        if (self._frames - 1) % self._stride:
            return
        self._images.append(image)
        # judged with a third of the window, two thirds, and all of it
        if len(self._images) % self._step == 0:
            self._judge()
        if len(self._images) >= self._window:
            self._images.clear()
            self._stride *= 2

    def _start(self, background: np.ndarray | None) -> None:
        self._background, self._images, self._frames, self._stride = background, [], 0, self._every
        self.problem = ""

    def _judge(self) -> None:
        self.problem = ""
        if shows_contact(self._tdn, self._background, estimate_background(self._images)):
            self.problem = (
                "the no-contact image shows a touch that the images do not have; lift the finger and call "
                "capture_background"
            )
