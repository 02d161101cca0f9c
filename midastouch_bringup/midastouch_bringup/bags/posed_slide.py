"""A slide over an object whose poses are known, from a sequence or a bag: poses first, images when they are chosen."""

from __future__ import annotations

from collections.abc import Collection
from functools import partial
from pathlib import Path

import numpy as np

from midastouch_common.errors import InputError
from midastouch_perception.tdn import estimate_background
from midastouch_perception.tdn.background import MOST_DOUBTFUL, doubtful_fraction

from ..datasets import load_sequence
from .frames import GelStream, read_bag
from .messages import TRUTH_FRAME
from .reader import is_bag

_ON_OBJECT = GelStream(base_frame=TRUTH_FRAME)
_BACKGROUND_FRAMES = 60


class PosedSlide:
    """The slide at `path`. Attribute: poses, T_obj_gel (N, 4, 4), as the robot or a tracker measured them.

    Of a bag, those of the stream, whose base frame is the object's. Raises InputError if there are none, or `path` is
    no sequence and no bag.
    """

    def __init__(self, path: str | Path, stream: GelStream = _ON_OBJECT):
        self._path = Path(path)
        self._frames = partial(read_bag, self._path, stream)
        self._sequence = None if is_bag(self._path) else load_sequence(self._path)
        if self._sequence is not None:
            self.poses = self._sequence.poses_measured
        else:
            self.poses = np.array([frame.base_from_gel for frame in self._frames()])

    def images(self, chosen: Collection[int]) -> list[np.ndarray]:
        """Images (320, 240, 3) uint8 RGB of some frames, in order. Raises InputError if one cannot be read."""
        if self._sequence is not None:
            return [self._sequence.image(i) for i in sorted(chosen)]
        wanted = set(chosen)
        return [frame.image for i, frame in enumerate(self._frames()) if i in wanted]

    def background(self, kept: np.ndarray | None = None) -> np.ndarray:
        """The no-contact image (320, 240, 3) uint8 RGB: the sequence's own, else the sensor's `kept` one, else what the
        images have in common.

        Raises InputError if they do not show the gel untouched.
        """
        if self._sequence is not None and (own := self._sequence.background) is not None:
            return own
        if kept is not None:
            return kept
        chosen = np.unique(np.linspace(0, len(self.poses) - 1, _BACKGROUND_FRAMES).round().astype(int))
        images = self.images(chosen.tolist())
        background = estimate_background(images)
        if doubtful_fraction(images, background) > MOST_DOUBTFUL:
            raise InputError(
                f"{self._path}: the images do not show all of the gel untouched; capture the sensor's no-contact image "
                "(capture_background) and name its --serial"
            )
        return background
