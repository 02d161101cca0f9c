"""The no-contact image that a sensor's images are compared with, and where it comes from."""

from __future__ import annotations

import numpy as np

from ..sensor_model import DIGIT_LAMPS, SensorModel
from .background_capture import RunningBackground
from .background_file import read_background
from .background_store import BackgroundStore
from .colour_layout import image_problem, shipped_layout


class SensorBackground:
    """Given by a file, else kept from an earlier start, else estimated from the first images; a captured one goes over
    all of these.

    Args: sensor, at image resolution; path of an image or a folder of images, or ""; store, or None; frames, number of
    images an estimate is made from. Raises InputError as `read_background`.
    Attributes: image (H, W, 3) uint8 RGB, None before the first one; source, where it is from, and problem, what cannot
    be right with it ("" if nothing), in words.
    """

    def __init__(self, sensor: SensorModel, path: str, store: BackgroundStore | None, frames: int):
        self._layout = shipped_layout() if sensor.lamps == DIGIT_LAMPS else None
        self._store = store
        self._running: RunningBackground | None = None
        self.image: np.ndarray | None = None
        self.source, self.problem = "none yet", ""
        size = sensor.height, sensor.width
        if path:
            self._set(read_background(path, *size), f"file {path}")
        elif store is not None and (kept := store.load(*size)) is not None:
            self._set(kept, f"kept in {store.path}")
        else:
            self._running = RunningBackground(frames)

    @property
    def change(self) -> float:
        """Grey levels by which the images changed that it is estimated from; 0 for one that is not estimated."""
        return self._running.change if self._running is not None else 0.0

    def observe(self, image: np.ndarray) -> None:
        """One more image (H, W, 3) uint8 of the sensor."""
        if self._running is None:
            return
        self._running.add(image)
        if self._running.image is not self.image:
            self._set(self._running.image, f"the first {self._running.count} images")

    def replace(self, image: np.ndarray) -> str:
        """Take a captured image (320, 240, 3) uint8 RGB; says in words whether it is kept for the next start."""
        self._running = None
        self._set(image, "capture_background")
        return self._store.keep(image) if self._store else "not kept for the next start: set the parameter serial"

    def _set(self, image: np.ndarray, source: str) -> None:
        self.image, self.source, self.problem = image, source, image_problem(image, self._layout)
