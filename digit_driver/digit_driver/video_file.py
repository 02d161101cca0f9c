"""A video file as a source."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from midastouch_common.errors import InputError

from .errors import CorruptFrameError
from .frame_source import MonotonicClock
from .pixels import recorded_portrait
from .playback import Playback

FALLBACK_FPS = 30.0


class VideoFile(Playback):
    """Plays a video of portrait DIGIT images, e.g. a YCB-Slide ``frames.mp4``.

    Args:
        path: the file; any format that OpenCV decodes.
        fps, loop, clock: see Playback. A file without a rate is played at 30 frames per second.
    """

    def __init__(self, path: Path, fps: float = 0.0, loop: bool = True, clock: MonotonicClock | None = None) -> None:
        super().__init__(fps, loop, clock)
        self._path = path
        self._capture: cv2.VideoCapture | None = None

    def _open_recording(self) -> tuple[str, float]:
        self.close()
        if not self._path.is_file():
            raise InputError(f"{self._path} is not a file: give an existing video")
        self._capture = cv2.VideoCapture(str(self._path))
        try:
            first = self._next_image()
        except CorruptFrameError:
            first = None
        if first is None:
            self.close()
            raise InputError(f"{self._path} cannot be decoded as a video: give e.g. an .mp4, or a folder of images")
        fps = self._capture.get(cv2.CAP_PROP_FPS)
        self._rewind()
        return str(self._path), fps if fps > 0.0 else FALLBACK_FPS

    def _next_image(self) -> np.ndarray | None:
        if not self._capture.grab():
            return None
        decoded, image = self._capture.retrieve()
        return recorded_portrait(image if decoded else None, str(self._path))

    def _rewind(self) -> None:
        # Seeking is inexact in many formats; opening the file again is not.
        self._capture.release()
        self._capture = cv2.VideoCapture(str(self._path))

    def close(self) -> None:
        if self._capture is not None:
            self._capture.release()
            self._capture = None
