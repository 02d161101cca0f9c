"""Image files and compressed images: whole, or refused.

OpenCV fills the missing part of a cut-off JPEG with grey and does not say so; a network takes that for a touch.
"""

from __future__ import annotations

import os
import re
from collections.abc import Collection
from pathlib import Path

import cv2
import numpy as np

from .errors import InputError
from .files import require_file

SUFFIXES = ".png", ".jpg", ".jpeg"
_JPEG_BEGIN, _JPEG_END = b"\xff\xd8", 0xD9
# Within the compressed pixels 0xff is followed by 0 or by the number of a restart, which are no markers of a segment.
_MARKER = re.compile(rb"\xff+([^\x00\xff\xd0-\xd7])")


class BrokenImageError(InputError):
    """The data are no image, or not all of one."""


def decode_image(data: bytes | np.ndarray, flags: int = cv2.IMREAD_COLOR) -> np.ndarray:
    """Pixels (H, W, 3) uint8 BGR of a JPEG, PNG or BMP; `flags` as of OpenCV's imdecode, for grey or reduced ones.

    data: bytes, or uint8 (N,). Raises BrokenImageError, which does not name the source: no image, or cut off.
    """
    content = bytes(data)
    if content.startswith(_JPEG_BEGIN) and not _has_end(content):
        raise BrokenImageError(f"JPEG of {len(content)} bytes is cut off: it has no end")
    pixels = cv2.imdecode(np.frombuffer(content, np.uint8), flags) if content else None
    if pixels is None:
        raise BrokenImageError("not a readable image")
    return pixels


def read_image_file(path: str | os.PathLike, flags: int = cv2.IMREAD_COLOR) -> np.ndarray:
    """Pixels of an image file, as `decode_image`. Raises InputError, naming it, if it is missing or no whole image."""
    path = require_file(path, "image")
    try:
        return decode_image(path.read_bytes(), flags)
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}; check the image file") from error
    except BrokenImageError as error:
        raise BrokenImageError(f"{path}: {error}; get the file again") from error


def image_files(folder: str | os.PathLike, suffixes: Collection[str] = SUFFIXES) -> list[Path]:
    """The images of a folder, by their names; hidden files are none: what a Mac adds, what is being written. No such
    folder has none."""
    files = sorted(Path(folder).glob("*"))
    return [file for file in files if file.suffix.lower() in suffixes and not file.name.startswith(".")]


def _has_end(jpeg: bytes) -> bool:
    """Whether the segments of a JPEG lead to its end; a small picture inside of them has an end of its own."""
    at = len(_JPEG_BEGIN)
    while marker := _MARKER.search(jpeg, at):
        if marker[1][0] == _JPEG_END:
            return True
        at = marker.end() + int.from_bytes(jpeg[marker.end() : marker.end() + 2], "big")
    return False
