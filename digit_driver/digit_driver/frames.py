"""Frames on their way from a camera to the user of the newest one: their types and errors."""

from __future__ import annotations

import threading
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any

import numpy as np


class DeviceError(RuntimeError):
    """The camera is absent, busy, unplugged or misbehaves; trying again may help."""


class CorruptFrameError(RuntimeError):
    """One frame was damaged on its way; the next one may be good."""


@dataclass(frozen=True)
class Frame:
    """One tactile image.

    Attributes:
        image: (H, W, 3) uint8, RGB, upright as the camera model defines it; a DIGIT's at QVGA is (320, 240, 3).
        stamp_monotonic_ns: time of acquisition on ``CLOCK_MONOTONIC``, nanoseconds.
        sequence: number given by the camera; a gap means frames were lost before they could be read.
    """

    image: np.ndarray
    stamp_monotonic_ns: int
    sequence: int


@dataclass(frozen=True)
class SourceInfo:
    """Description of an open camera.

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


class ReaderState(Enum):
    """State of the reader."""

    STOPPED = "stopped"
    CONNECTING = "connecting"
    STREAMING = "streaming"
    DISCONNECTED = "disconnected"
    FAILED = "failed"


@dataclass(frozen=True)
class ReaderStatus:
    """Counters since ``start``.

    Attributes:
        state: see ReaderState.
        info: the camera, once it has been open.
        frames: good frames read.
        lost: frames that the camera produced but that were never read (gaps in its numbering).
        corrupt: damaged frames, not passed on.
        overwritten: good frames replaced by a newer one before they were taken.
        reconnects: times the camera came back.
        last_error: reason of the camera's last failure; kept after it came back.
        silent_s: time since the thread last gave a sign of life; more than a second means that a call hangs.
    """

    state: ReaderState = ReaderState.STOPPED
    info: SourceInfo | None = None
    frames: int = 0
    lost: int = 0
    corrupt: int = 0
    overwritten: int = 0
    reconnects: int = 0
    last_error: str = ""
    silent_s: float = 0.0


class FrameSlot:
    """Slot for one frame, replaced by every newer one, and the counters; one thread writes it, others read it."""

    def __init__(self, state: ReaderState) -> None:
        self._lock = threading.Lock()
        self._status = ReaderStatus(state=state)
        self._newest: Frame | None = None

    @property
    def status(self) -> ReaderStatus:
        """Counters at present, without ``silent_s``, which the reader adds."""
        with self._lock:
            return self._status

    def put(self, frame: Frame, lost: int) -> None:
        """Store a good frame, before which ``lost`` others were lost."""
        with self._lock:
            status, overwritten = self._status, self._newest is not None
            self._newest = frame
            self._status = replace(
                status, frames=status.frames + 1, lost=status.lost + lost, overwritten=status.overwritten + overwritten
            )

    def take(self) -> Frame | None:
        """Return the newest frame that was not taken yet; None without one."""
        with self._lock:
            frame, self._newest = self._newest, None
        return frame

    def count_corrupt(self, reason: str) -> None:
        """Count a damaged frame."""
        with self._lock:
            self._status = replace(self._status, corrupt=self._status.corrupt + 1, last_error=reason)

    def update(self, **changes: Any) -> None:
        """Set fields of the status."""
        with self._lock:
            self._status = replace(self._status, **changes)
