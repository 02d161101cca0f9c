"""What the thread that reads a camera hands over: the newest frame, and what became of the others."""

from __future__ import annotations

import threading
from dataclasses import dataclass, replace
from enum import Enum

from .frame_source import Frame, SourceInfo


class ReaderState(Enum):
    """What the reader is doing."""

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
        lost: frames that the camera produced and nobody could read (gaps in its numbering).
        corrupt: damaged frames, not passed on.
        overwritten: good frames replaced by a newer one before they were taken.
        reconnects: times the camera came back.
        last_error: why it failed last; kept after it came back.
        silent_s: time since the thread last gave a sign of life; more than a second means a call that hangs.
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
    """One frame, replaced by every newer one, and the counters; written by one thread and read by others."""

    def __init__(self, state: ReaderState) -> None:
        self._lock = threading.Lock()
        self._status = ReaderStatus(state=state)
        self._newest: Frame | None = None

    @property
    def status(self) -> ReaderStatus:
        """The counters now; ``silent_s`` is left to who knows of the thread."""
        with self._lock:
            return self._status

    def put(self, frame: Frame, lost: int) -> None:
        """Takes a good frame, before which ``lost`` others were lost."""
        with self._lock:
            status, overwritten = self._status, self._newest is not None
            self._newest = frame
            self._status = replace(
                status,
                frames=status.frames + 1,
                lost=status.lost + lost,
                overwritten=status.overwritten + overwritten,
            )

    def take(self) -> Frame | None:
        """The newest frame that was not taken yet."""
        with self._lock:
            frame, self._newest = self._newest, None
        return frame

    def count_corrupt(self, reason: str) -> None:
        """Counts a damaged frame."""
        with self._lock:
            self._status = replace(self._status, corrupt=self._status.corrupt + 1, last_error=reason)

    def update(self, **changes: object) -> None:
        """Sets fields of the status."""
        with self._lock:
            self._status = replace(self._status, **changes)
