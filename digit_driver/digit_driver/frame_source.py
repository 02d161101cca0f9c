"""What a camera gives: frames, and what is known about itself."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Frame:
    """One tactile image.

    Attributes:
        image: (H, W, 3) uint8, RGB, upright as the camera model says; a DIGIT's at QVGA is (320, 240, 3).
        stamp_monotonic_ns: time of acquisition on ``CLOCK_MONOTONIC``, nanoseconds.
        sequence: number given by the camera; a gap means frames were lost before they could be read.
    """

    image: np.ndarray
    stamp_monotonic_ns: int
    sequence: int


@dataclass(frozen=True)
class SourceInfo:
    """What is known about an open camera.

    Attributes:
        name: its device node.
        serial: serial number of the sensor, empty when there is none.
        width, height: size of the image, pixels.
        fps: frames per second that the camera promises.
        warnings: facts about this camera that the user should know, ready to print.
    """

    name: str
    serial: str
    width: int
    height: int
    fps: float
    warnings: tuple[str, ...] = ()

    def __str__(self) -> str:
        serial = f" (serial {self.serial})" if self.serial else ""
        return f"{self.name}{serial}, {self.width}x{self.height} at {self.fps:g} frames/s"


class MonotonicClock:
    """The host's ``CLOCK_MONOTONIC``; tests put their own in its place."""

    def now_ns(self) -> int:
        """Nanoseconds."""
        return time.monotonic_ns()
