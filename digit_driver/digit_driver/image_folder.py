"""A folder of images as a source: plain, or a YCB-Slide sequence (simulated or real)."""

from __future__ import annotations

import re
from pathlib import Path

import cv2
import numpy as np

from midastouch_common.errors import InputError

from .errors import CorruptFrameError
from .frame_source import MonotonicClock
from .pixels import recorded_portrait
from .playback import Playback

IMAGE_SUFFIXES = {".jpg", ".jpeg", ".png", ".bmp"}
SENSOR_FPS = 60.0
LAYOUTS = {"tactile_images": 10.0, "frames": 30.0}
"""Image folders of a YCB-Slide sequence (simulated, real) and the rate they are played at: the paper's loop
plays simulated slides at 10 Hz; real ones were recorded at 30 Hz."""


class ImageFolder(Playback):
    """Plays the images of a folder in the order of their numbers (2 before 10).

    Args:
        path: folder of images, or of a YCB-Slide sequence.
        fps, loop, clock: see Playback.
    """

    def __init__(self, path: Path, fps: float = 0.0, loop: bool = True, clock: MonotonicClock | None = None) -> None:
        super().__init__(fps, loop, clock)
        self._path = path
        self._files: list[Path] = []
        self._next = 0

    def _open_recording(self) -> tuple[str, float]:
        folder, fps = _image_folder(self._path)
        self._files = list_images(folder)
        if not self._files:
            raise InputError(
                f"{self._path} holds no images ({' '.join(sorted(IMAGE_SUFFIXES))}), neither directly nor in "
                f"{' or '.join(f'{name}/' for name in LAYOUTS)}. "
                "Give a folder of DIGIT images or a YCB-Slide sequence."
            )
        # A wrong folder is told by its first image, before anything has been published.
        try:
            _load(self._files[0])
        except CorruptFrameError as error:
            raise InputError(f"{error}: replace or remove this file") from error
        self._next = 0
        return str(folder), fps

    def _next_image(self) -> np.ndarray | None:
        if self._next == len(self._files):
            return None
        self._next += 1
        return _load(self._files[self._next - 1])

    def _rewind(self) -> None:
        self._next = 0

    def close(self) -> None:
        self._files = []
        self._next = 0


def list_images(folder: Path) -> list[Path]:
    """The images of a folder, sorted as a person would: numbers in their names by value."""
    files = [path for path in folder.iterdir() if path.suffix.lower() in IMAGE_SUFFIXES and path.is_file()]
    return sorted(files, key=lambda path: _natural_key(path.name))


def _natural_key(name: str) -> list[tuple[int, int, str]]:
    parts = re.split(r"(\d+)", name)
    return [(1, int(part), part) if part.isdecimal() else (0, 0, part) for part in parts]


def _image_folder(path: Path) -> tuple[Path, float]:
    if not path.is_dir():
        raise InputError(f"{path} is not a folder: give an existing folder of images or a YCB-Slide sequence")
    for name, fps in LAYOUTS.items():
        if (path / name).is_dir():
            return path / name, fps
    return path, LAYOUTS.get(path.name, SENSOR_FPS)


def _load(path: Path) -> np.ndarray:
    # Read in Python: OpenCV only prints a warning for a file it may not read.
    try:
        data = np.frombuffer(path.read_bytes(), np.uint8)
    except OSError as error:
        raise CorruptFrameError(f"{path}: {error.strerror}") from error
    return recorded_portrait(cv2.imdecode(data, cv2.IMREAD_COLOR) if data.size else None, str(path))
