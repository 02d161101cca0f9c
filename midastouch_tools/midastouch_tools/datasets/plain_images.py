"""Tactile images without poses: a folder of images, or a video. `midastouch replay` plays them."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from midastouch_common.errors import InputError
from midastouch_common.images import image_files, read_image_file
from midastouch_common.message_arrays import SECOND

from .sequence import IMAGE_SHAPE

_SUFFIXES = {".jpg", ".jpeg", ".png", ".bmp"}
_OF_YCB_SLIDE = ("tactile_images", "frames")
_FOLDER_FPS, _VIDEO_FPS = 60.0, 30.0  # of a DIGIT; of a video that states none


class PlainImages:
    """The images of a folder in the order of their numbers (2 before 10), or the frames of a video file.

    fps: images per second, 60 for a folder. n_frames: number of images; for a video, the number its header claims.
    rotation: degrees by which images are turned, as in `upright`. Raises InputError, naming the file, if there is no
    image, or one is damaged or has another shape.
    """

    def __init__(self, path: str | Path, rotation: int = 0) -> None:
        self.path, self._rotation = Path(path), rotation
        self._files = _numbered(self.path) if self.path.is_dir() else []
        self.fps, self.n_frames = _FOLDER_FPS, len(self._files)
        if not self.path.is_dir():
            capture = cv2.VideoCapture(str(self.path))
            fps, claimed = capture.get(cv2.CAP_PROP_FPS), capture.get(cv2.CAP_PROP_FRAME_COUNT)
            # a stream without an index claims a negative count
            self.fps, self.n_frames = fps if 0 < fps < math.inf else _VIDEO_FPS, max(int(claimed), 1)
            capture.release()
        if next(self.frames(), None) is None:
            raise InputError(f"{self.path}: cannot be decoded as a video; give an .mp4, a bag or a folder of images")

    @staticmethod
    def are_at(path: Path) -> bool:
        """Return whether `path` is a file, which may be a video, or a folder with images directly in it.

        An incomplete folder of YCB-Slide does not count: its images are in a folder inside, next to a background.
        """
        if any((path / inside).is_dir() for inside in _OF_YCB_SLIDE):
            return False
        return path.is_file() or (path.is_dir() and bool(_numbered(path)))

    def frames(self, offset_ns: int = 0) -> Iterator[tuple[int, np.ndarray]]:
        """Yield stamp [ns], 1 s at the first, and image (320, 240, 3) uint8 RGB of each frame from `offset_ns` on."""
        for i, (name, image) in enumerate(self._decoded()):
            since = round(i * SECOND / self.fps)
            if since >= offset_ns:
                try:
                    yield SECOND + since, cv2.cvtColor(upright(image, self._rotation), cv2.COLOR_BGR2RGB)
                except InputError as error:
                    raise InputError(f"{name}: {error}") from error

    def _decoded(self) -> Iterator[tuple[str, np.ndarray]]:
        if self._files:
            yield from ((str(file), read_image_file(file)) for file in self._files)
            return
        capture = cv2.VideoCapture(str(self.path))
        while (read := capture.read())[0]:
            yield str(self.path), read[1]
        capture.release()


def _numbered(folder: Path) -> list[Path]:
    files = [path for path in image_files(folder, _SUFFIXES) if path.is_file()]
    return sorted(files, key=lambda path: [(int(p) if p.isdecimal() else -1, p) for p in re.split(r"(\d+)", path.name)])


def upright(image: np.ndarray, rotation: int = 0) -> np.ndarray:
    """Return an image (H, W, 3) turned by `rotation` degrees counter-clockwise, and scaled to 240 x 320 pixels.

    rotation: 0, 90, 180 or 270. Raises InputError if the turned image is not portrait with sides of 3:4.
    """
    rows, columns, _ = IMAGE_SHAPE
    image = np.ascontiguousarray(np.rot90(image, rotation // 90))
    height, width = image.shape[:2]
    if height * columns != width * rows:
        fix = "crop it to portrait, with sides of 3:4"
        if height * rows == width * columns:
            fix = "rotate it (rotation 90: counter-clockwise, for images in the camera's own order)"
        raise InputError(f"image is {width} x {height} pixels, expected {columns} x {rows}; {fix}")
    return image if image.shape == IMAGE_SHAPE else cv2.resize(image, (columns, rows), interpolation=cv2.INTER_AREA)
