"""What all recordings have in common: frames that become due at a fixed rate, once or in a loop."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np

from midastouch_common.errors import InputError

from .errors import CorruptFrameError, EndOfStreamError
from .frame_source import PORTRAIT_SHAPE, Frame, FrameSource, MonotonicClock, SourceInfo


class Playback(FrameSource):
    """Plays a recording as if it were the sensor.

    A frame is never skipped: a reader that comes late gets it at once, stamped with the time it was due.

    Args:
        fps: frames per second; 0 for the recording's own rate.
        loop: begin again after the last frame.
        clock: the host's monotonic clock.
    """

    def __init__(self, fps: float = 0.0, loop: bool = True, clock: MonotonicClock | None = None) -> None:
        self._fps = fps
        self._loop = loop
        self._clock = clock or MonotonicClock()
        self._period_ns = 0
        self._start_ns = 0
        self._sequence = 0

    def open(self) -> SourceInfo:
        name, own_fps = self._open_recording()
        fps = self._fps or own_fps
        self._period_ns = round(1e9 / fps)
        self._start_ns = self._clock.now_ns()
        self._sequence = 0
        height, width, _ = PORTRAIT_SHAPE
        return SourceInfo(name, "", width, height, fps, live=False)

    def read(self, timeout: float) -> Frame | None:
        due_ns = self._start_ns + self._sequence * self._period_ns
        wait = (due_ns - self._clock.now_ns()) * 1e-9
        if wait > timeout:
            self._clock.sleep(timeout)
            return None
        if wait > 0.0:
            self._clock.sleep(wait)
        sequence = self._sequence
        # Counted before it is decoded, so that a damaged frame is passed over and not tried for ever.
        self._sequence += 1
        try:
            return Frame(self._next_or_first(), due_ns, sequence)
        except InputError as error:
            # the first image was one of a DIGIT; a stray one among the others must not end the rest
            raise CorruptFrameError(str(error)) from error

    def _next_or_first(self) -> np.ndarray:
        image = self._next_image()
        if image is None and self._loop:
            self._rewind()
            image = self._next_image()
        if image is None:
            raise EndOfStreamError("the recording has ended")
        return image

    @abstractmethod
    def _open_recording(self) -> tuple[str, float]:
        """Opens it at its first frame; returns its name and its own frame rate. Raises InputError."""

    @abstractmethod
    def _next_image(self) -> np.ndarray | None:
        """(320, 240, 3) uint8 RGB, None after the last. Raises CorruptFrameError for one to pass over."""

    @abstractmethod
    def _rewind(self) -> None:
        """Goes back to the first frame."""
