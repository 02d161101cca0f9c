"""Reading of image files and compressed images; damaged ones are refused.

OpenCV fills the missing or damaged part of a JPEG with colours of its own, which a network takes for a touch. Pillow
does so, too, unless the damage looks like a marker; simplejpeg refuses it.
"""

from __future__ import annotations

import os
import re
import zlib
from collections.abc import Collection
from pathlib import Path

import cv2
import numpy as np
import simplejpeg

from .errors import InputError
from .files import require_file

SUFFIXES = ".png", ".jpg", ".jpeg"
_JPEG_BEGIN, _PNG_BEGIN = b"\xff\xd8", b"\x89PNG\r\n\x1a\n"
_EXIF, _EXIF_BEFORE = b"Exif\x00\x00", 1 << 16
_MOST_PIXELS = 1 << 26
_PADDED = re.compile(r"[1-7] extraneous bytes before marker 0xd9$")  # some cameras fill up their frames to whole words
REDUCTIONS = {cv2.IMREAD_REDUCED_COLOR_2: 2, cv2.IMREAD_REDUCED_COLOR_4: 4, cv2.IMREAD_REDUCED_COLOR_8: 8}
"""Factor by which each of OpenCV's flags divides an image's sides."""


class BrokenImageError(InputError):
    """The data are not an image, or only a part of one."""


def decode_image(data: bytes | np.ndarray, flags: int = cv2.IMREAD_COLOR) -> np.ndarray:
    """Return the pixels (H, W, 3) uint8 BGR of a JPEG, PNG or BMP, given as bytes or uint8 (N,).

    `flags` are those of OpenCV's imdecode, for grey (H, W) or reduced images. Raises BrokenImageError if the data are
    no image, cut off or damaged; the message does not name the source.
    """
    content = np.frombuffer(bytes(data), np.uint8)
    if content[:2].tobytes() == _JPEG_BEGIN:
        pixels = _jpeg(content, "GRAY" if flags == cv2.IMREAD_GRAYSCALE else "BGR", REDUCTIONS.get(flags, 1))
        if _EXIF not in content[:_EXIF_BEFORE].tobytes():  # by which OpenCV turns an image
            return pixels
    if content[:8].tobytes() == _PNG_BEGIN and (fault := _png_fault(content.data)):
        raise BrokenImageError(f"PNG of {len(content)} bytes {fault}")
    pixels = cv2.imdecode(content, flags) if len(content) else None
    if pixels is None:
        raise BrokenImageError("not a readable image")
    return pixels


def _jpeg(content: np.ndarray, colours: str, reduction: int) -> np.ndarray:
    try:
        height, width, *_ = simplejpeg.decode_jpeg_header(content)
        if height * width > _MOST_PIXELS:
            raise ValueError(f"{width} x {height} pixels are too many")
        height, width = -(-height // reduction), -(-width // reduction)

        def decoded(strict: bool) -> np.ndarray:
            return simplejpeg.decode_jpeg(content, colours, min_height=height, min_width=width, strict=strict)

        try:
            pixels = decoded(strict=True)
        except ValueError as error:
            if not _PADDED.search(str(error)):
                raise
            pixels = decoded(strict=False)
    except ValueError as error:
        raise BrokenImageError(f"JPEG of {len(content)} bytes is cut off or damaged: {error}") from error
    return pixels[..., 0] if colours == "GRAY" else pixels


def _png_fault(content: memoryview) -> str:
    """Return why a PNG is not whole, by the length and the checksum of each of its parts; empty if it is.

    OpenCV takes the colours of some damaged parts, and works for half a minute on a length that is wrong.
    """
    at, kind = len(_PNG_BEGIN), b""
    while kind != b"IEND":
        if at + 12 > len(content) or (end := at + 12 + int.from_bytes(content[at : at + 4], "big")) > len(content):
            return "is cut off"
        kind = bytes(content[at + 4 : at + 8])
        if zlib.crc32(content[at + 4 : end - 4]) != int.from_bytes(content[end - 4 : end], "big"):
            return "is damaged"
        at = end
    return ""


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
