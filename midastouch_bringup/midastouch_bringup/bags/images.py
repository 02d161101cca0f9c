"""The tactile images of a bag."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from midastouch_common.errors import InputError
from midastouch_common.message_arrays import rgb_from_msg

from .messages import COMPRESSED_TYPE, IMAGE_TYPE, Message, typestore
from .reader import bag_messages, bag_topics, readable


def image_messages(path: str | Path, topic: str) -> Iterator[Message]:
    """The images of a bag on a topic; where there are none, the compressed ones beside it.

    Raises InputError as `bag_messages`.
    """
    present, compressed = {each.name for each in bag_topics(path)}, f"{topic}/compressed"
    return bag_messages(path, {compressed if topic not in present and compressed in present else topic})


def decode_image(message: Message, path: Path) -> np.ndarray:
    """Pixels (320, 240, 3) uint8 RGB of an Image (rgb8, bgr8) or a CompressedImage from the bag at `path`.

    Raises InputError if it holds no such image.
    """
    with readable(path):
        content = typestore().deserialize_cdr(message.data, message.type_name)
    what = f"{path}: image on {message.topic} at {message.stamp_ns / 1e9:.3f} s"
    if message.type_name not in (IMAGE_TYPE, COMPRESSED_TYPE):
        raise InputError(f"{what} is {message.type_name}; record images")
    try:
        return _rgb(content, 320, 240) if message.type_name == COMPRESSED_TYPE else rgb_from_msg(content, 320, 240)
    except InputError as error:
        raise InputError(f"{what}: {error}; record it again") from error


def _rgb(compressed: object, height: int, width: int) -> np.ndarray:
    data = np.asarray(compressed.data)
    pixels = cv2.imdecode(data, cv2.IMREAD_COLOR_RGB) if data.size else None
    if pixels is None:
        raise InputError("it cannot be decompressed")
    if pixels.shape != (height, width, 3):
        raise InputError(f"image is {pixels.shape[1]} x {pixels.shape[0]} pixels, expected {width} x {height}")
    return pixels
