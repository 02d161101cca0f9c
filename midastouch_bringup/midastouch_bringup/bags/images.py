"""The tactile images of a bag."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from midastouch_perception.errors import InputError

from .messages import COMPRESSED_TYPE, IMAGE_TYPE, Message, typestore
from .reader import readable


def decode_image(message: Message, path: Path) -> np.ndarray:
    """Pixels (320, 240, 3) uint8 RGB of an Image (rgb8, bgr8) or a CompressedImage from the bag at `path`.

    Raises InputError if it holds no such image.
    """
    with readable(path):
        content = typestore().deserialize_cdr(message.data, message.type_name)
    what = f"{path}: image on {message.topic} at {message.stamp_ns / 1e9:.3f} s"
    if message.type_name == COMPRESSED_TYPE:
        pixels = cv2.imdecode(np.asarray(content.data), cv2.IMREAD_COLOR_RGB)
        if pixels is None:
            raise InputError(f"{what} cannot be decompressed; record it again")
    elif message.type_name == IMAGE_TYPE and content.encoding in ("rgb8", "bgr8"):
        if content.step < 3 * content.width or content.data.size != content.step * content.height:
            raise InputError(f"{what} has {content.data.size} bytes for its size; record it again")
        rows = content.data.reshape(content.height, content.step)[:, : 3 * content.width]
        pixels = rows.reshape(content.height, content.width, 3)
        pixels = pixels[..., ::-1] if content.encoding == "bgr8" else pixels
    else:
        kind = content.encoding if message.type_name == IMAGE_TYPE else message.type_name
        raise InputError(f"{what} is {kind}; record rgb8, bgr8 or compressed images")
    if pixels.shape != (320, 240, 3):
        raise InputError(
            f"{what} is {pixels.shape[1]} x {pixels.shape[0]}, expected a portrait DIGIT image of 240 x 320"
        )
    return np.ascontiguousarray(pixels)
