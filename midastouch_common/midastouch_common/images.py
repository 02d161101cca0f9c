"""Reading of image files and compressed images; incomplete ones are refused.

OpenCV silently fills the missing part of a cut-off JPEG with grey, which a network takes for a touch.
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
# 0xff followed by 0 or by a restart number (0xd0 to 0xd7) is part of the compressed pixels and starts no segment.
_MARKER = re.compile(rb"\xff+([^\x00\xff\xd0-\xd7])")


class BrokenImageError(InputError):
    """The data are not an image, or only a part of one."""


def decode_image(data: bytes | np.ndarray, flags: int = cv2.IMREAD_COLOR) -> np.ndarray:
    """Return the pixels (H, W, 3) uint8 BGR of a JPEG, PNG or BMP, given as bytes or uint8 (N,).

    `flags` are those of OpenCV's imdecode, for grey or reduced images. Raises BrokenImageError if the data are no image
    or cut off; the message does not name the source.
    """
    content = bytes(data)
    if content.startswith(_JPEG_BEGIN) and not _has_end(content):
        raise BrokenImageError(f"JPEG of {len(content)} bytes is cut off: it has no end")
    pixels = cv2.imdecode(np.frombuffer(content, np.uint8), flags) if content else None
    if pixels is None:
        raise BrokenImageError("not a readable image")
    return pixels


def read_image_file(path: str | os.PathLike, flags: int = cv2.IMREAD_COLOR) -> np.ndarray:
    """Return the pixels of an image file as `decode_image` does; InputError naming it if it is missing or broken."""
    path = require_file(path, "image")
    try:
        return decode_image(path.read_bytes(), flags)
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}; check the image file") from error
    except BrokenImageError as error:
        raise BrokenImageError(f"{path}: {error}; get the file again") from error


def image_files(folder: str | os.PathLike, suffixes: Collection[str] = SUFFIXES) -> list[Path]:
    """Return the images of a folder, sorted by name; an empty list if there is no such folder.

    Hidden files are left out: those that macOS adds, and those that are still being written."""
    files = sorted(Path(folder).glob("*"))
    return [file for file in files if file.suffix.lower() in suffixes and not file.name.startswith(".")]


def _has_end(jpeg: bytes) -> bool:
    """Return whether the segments of a JPEG lead to its end marker; that of a thumbnail inside a segment is skipped."""
    at = len(_JPEG_BEGIN)
    while marker := _MARKER.search(jpeg, at):
        if marker[1][0] == _JPEG_END:
            return True
        at = marker.end() + int.from_bytes(jpeg[marker.end() : marker.end() + 2], "big")
    return False
