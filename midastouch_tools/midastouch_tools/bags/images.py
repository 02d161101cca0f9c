"""A bag frame by frame: its images with the poses at their stamps."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from midastouch_common import images
from midastouch_common.errors import InputError
from midastouch_common.frames import BASE_FRAME, GEL_FRAME, TRUTH_FRAME, TRUTH_GEL_FRAME
from midastouch_common.images import BrokenImageError
from midastouch_common.message_arrays import rgb_from_msg
from midastouch_common.transforms.rigid import TransformError

from ..datasets.plain_images import upright
from .messages import COMPRESSED_TYPE, IMAGE_TOPIC, IMAGE_TYPE, Message, header_stamp_ns
from .reader import bag_messages, bag_topics, content_of, readable
from .transforms import recorded_transforms


@dataclass(frozen=True)
class GelStream:
    """Names in a bag: the topic of one gel's images, and the two frames between which the gel's pose is given.

    rotation: degrees counter-clockwise by which the images are turned.
    """

    image_topic: str = IMAGE_TOPIC
    base_frame: str = BASE_FRAME
    gel_frame: str = GEL_FRAME
    rotation: int = 0


OWN = GelStream()
"""The names that recordings of this project use."""


class BagFrame(NamedTuple):
    """One image of a bag with the poses at its stamp.

    stamp_ns: of the image's header; image: (320, 240, 3) uint8 RGB; base_from_gel: T_base_gel (4, 4);
    object_from_gel_true: T_obj_gel (4, 4) from the ground truth frames, None if the bag has none.
    """

    stamp_ns: int
    image: np.ndarray
    base_from_gel: np.ndarray
    object_from_gel_true: np.ndarray | None


def read_bag(path: str | Path, stream: GelStream = OWN) -> Iterator[BagFrame]:
    """Yield every image of a stream whose stamp the transforms span, in recorded order, deterministically.

    All transforms are read first, then interpolated at each image's stamp, so nothing depends on the order in which
    images and transforms were recorded. Images before the first or after the last transform are left out, as are
    damaged ones and invalid transforms (not finite, no unit quaternion), as in the filter's node; stderr counts them.
    If the topic is missing, the topic of its compressed images is read instead. Raises InputError if the bag cannot be
    read, if it lacks the topic, the transforms or whole images, or if time runs backwards in a frame on which the gel's
    pose or the true pose depends.
    """
    path, ends = Path(path), (stream.base_frame, stream.gel_frame)
    transforms, refused = recorded_transforms(path, (ends, (TRUTH_FRAME, TRUTH_GEL_FRAME)))
    used, outside, reason, broken = 0, 0, "it is empty", []
    for message in image_messages(path, stream.image_topic):
        with readable(path):
            stamp = header_stamp_ns(message.data)
        try:
            pose = transforms.lookup(*ends, stamp)
        except TransformError as error:
            outside, reason = outside + 1, "; ".join(filter(None, (str(error), refused)))
            continue
        try:
            pixels = decode_image(message, path, stream.rotation)
        except BrokenImageError as error:
            broken.append(error)
            continue
        used, truth = used + 1, None
        with contextlib.suppress(TransformError):
            truth = transforms.lookup(TRUTH_FRAME, TRUTH_GEL_FRAME, stamp)
        yield BagFrame(stamp, pixels, pose, truth)
    if broken and not used:
        raise broken[0]
    if broken:
        print(f"{broken[0]} ({len(broken)} of {used + len(broken)} images are damaged and left out)", file=sys.stderr)
    if outside and used:
        print(f"{path}: {outside} of {used + outside} images have no pose and are left out: {reason}", file=sys.stderr)
    if not used:
        raise InputError(f"{path}: no image on {stream.image_topic} has a pose ({reason}); record /tf and /tf_static")


def image_messages(path: str | Path, topic: str) -> Iterator[Message]:
    """Return the images of a bag on a topic or, if the topic has none, those on `TOPIC/compressed`.

    Raises InputError as `bag_messages` does.
    """
    present, compressed = {each.name for each in bag_topics(path)}, f"{topic}/compressed"
    return bag_messages(path, {compressed if topic not in present and compressed in present else topic})


def decode_image(message: Message, path: Path, rotation: int = 0) -> np.ndarray:
    """Return the pixels (320, 240, 3) uint8 RGB of an image of the bag at `path`, turned and scaled by `upright`.

    Raises InputError as `decode_raw` does, and if the image is not portrait with sides of 3:4.
    """
    pixels = decode_raw(message, path)[1]
    with _naming(message, path):
        return upright(pixels, rotation)


def decode_raw(message: Message, path: Path) -> tuple[str, np.ndarray]:
    """Return encoding and pixels (H, W, 3) uint8 RGB of an Image (rgb8, bgr8, ...) or CompressedImage of a bag.

    Raises InputError if it holds no such image, and its subclass BrokenImageError if the image is damaged.
    """
    content = content_of(message, path)
    with _naming(message, path):
        if message.type_name == COMPRESSED_TYPE:
            return content.format, cv2.cvtColor(images.decode_image(content.data), cv2.COLOR_BGR2RGB)
        if message.type_name == IMAGE_TYPE:
            return content.encoding, rgb_from_msg(content, content.height, content.width)
        raise InputError(f"is {message.type_name}; record images")


@contextlib.contextmanager
def _naming(message: Message, path: Path) -> Iterator[None]:
    what = f"{path}: image on {message.topic} at {message.stamp_ns / 1e9:.3f} s"
    try:
        yield
    except BrokenImageError as error:
        raise BrokenImageError(f"{what}: {error}; record it again") from error
    except InputError as error:
        raise InputError(f"{what}: {error}") from error
