"""The one interface behind which a DIGIT, an image folder and a video look alike."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

PORTRAIT_SHAPE = (320, 240, 3)
"""Rows, columns and channels of the image every DIGIT tool expects."""


@dataclass(frozen=True)
class Frame:
    """One tactile image.

    Attributes:
        image: (H, W, 3) uint8, RGB: (320, 240, 3), portrait, but for other modes and camera models.
        stamp_monotonic_ns: time of acquisition on ``CLOCK_MONOTONIC``, nanoseconds.
        sequence: number given by the source; a gap means frames were lost before they could be read.
    """

    image: np.ndarray
    stamp_monotonic_ns: int
    sequence: int


@dataclass(frozen=True)
class SourceInfo:
    """What is known about an open source.

    Attributes:
        name: what to call it in messages: device node or path.
        serial: serial number of the sensor, empty when there is none.
        width, height: size of the image, pixels.
        fps: frames per second that the source promises.
        live: true for a physical sensor, whose images are never exactly equal.
        warnings: facts about this source that the user should know, ready to print.
    """

    name: str
    serial: str
    width: int
    height: int
    fps: float
    live: bool
    warnings: tuple[str, ...] = ()

    def __str__(self) -> str:
        serial = f" (serial {self.serial})" if self.serial else ""
        return f"{self.name}{serial}, {self.width}x{self.height} at {self.fps:g} frames/s"


class MonotonicClock:
    """The host's ``CLOCK_MONOTONIC`` and sleeping on it; tests put their own in its place."""

    def now_ns(self) -> int:
        return time.monotonic_ns()

    def sleep(self, seconds: float) -> None:
        time.sleep(seconds)


class FrameSource(ABC):
    """A stream of frames. One thread opens, reads and closes; ``set_leds`` may come from any thread."""

    @abstractmethod
    def open(self) -> SourceInfo:
        """Acquires the source; afterwards ``read`` gives frames.

        Raises:
            InputError: the source can never be opened as it was asked for.
            DeviceError: it cannot be opened now.
        """

    @abstractmethod
    def read(self, timeout: float) -> Frame | None:
        """Waits at most ``timeout`` seconds for the next frame; None when none came.

        Raises:
            CorruptFrameError: a frame came, but damaged.
            DeviceError: the source is gone; close it, and perhaps open it again.
            EndOfStreamError: there will be no further frame.
        """

    @abstractmethod
    def close(self) -> None:
        """Gives the source back. May be called at any time and more than once."""

    def set_leds(self, rgb: tuple[int, int, int]) -> None:  # noqa: B027 (ignoring it is the right default)
        """Sets the brightness of the sensor's LEDs, 0...15 each, now and after every later ``open``.

        Sources without LEDs ignore it: a recording cannot be lit again.
        """
