"""From the bytes of one camera buffer to an RGB image."""

from __future__ import annotations

import cv2
import numpy as np

from .errors import CorruptFrameError
from .videodev2 import PIX_FMT_MJPEG, PIX_FMT_YUYV

_JPEG_END = b"\xff\xd9"


_REDUCED = {1: cv2.IMREAD_COLOR, 2: cv2.IMREAD_REDUCED_COLOR_2, 4: cv2.IMREAD_REDUCED_COLOR_4}
_REDUCED[8] = cv2.IMREAD_REDUCED_COLOR_8


def decode(data: bytes, pixel_format: int, width: int, height: int, reduction: int = 1) -> np.ndarray:
    """(height, width, 3) uint8 RGB image of one buffer; a JPEG's sides divided by ``reduction`` (rounded up).

    Args:
        data: the used part of the buffer.
        pixel_format: ``PIX_FMT_YUYV`` or ``PIX_FMT_MJPEG``.
        width, height: size of the camera's image.
        reduction: 1, 2, 4 or 8: a large JPEG is decoded several times faster at an eighth of its size.

    Raises:
        CorruptFrameError: the buffer does not hold one whole image.
    """
    if pixel_format == PIX_FMT_YUYV:
        if len(data) != 2 * width * height:
            raise CorruptFrameError(f"{len(data)} bytes instead of {2 * width * height}")
        packed = np.frombuffer(data, np.uint8).reshape(height, width, 2)
        return cv2.cvtColor(packed, cv2.COLOR_YUV2RGB_YUYV)
    if pixel_format == PIX_FMT_MJPEG:
        # The decoder fills the missing part of a cut-off JPEG with grey, which a net would take for a touch.
        if not data.rstrip(b"\0").endswith(_JPEG_END):
            raise CorruptFrameError(f"JPEG of {len(data)} bytes has no end")
        image = cv2.imdecode(np.frombuffer(data, np.uint8), _REDUCED[reduction])
        if image is None or image.shape != (-(-height // reduction), -(-width // reduction), 3):
            raise CorruptFrameError(f"JPEG of {len(data)} bytes is not a {width}x{height} image")
        return cv2.cvtColor(image, cv2.COLOR_BGR2RGB)
    raise ValueError(f"pixel format {pixel_format:#x}")
