"""A bag frame by frame: each image with the poses at its stamp."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from midastouch_common.errors import InputError
from midastouch_filter.transforms import TransformBuffer, TransformError

from .images import decode_image, image_messages
from .messages import BASE_FRAME, GEL_FRAME, IMAGE_TOPIC, TRUTH_FRAME, TRUTH_GEL_FRAME, header_stamp_ns
from .reader import readable
from .transforms import recorded_transforms


@dataclass(frozen=True)
class GelStream:
    """What a bag calls the images of one gel, and the frames between which the gel's poses are told."""

    image_topic: str = IMAGE_TOPIC
    base_frame: str = BASE_FRAME
    gel_frame: str = GEL_FRAME


OWN = GelStream()
"""As recordings of this project name it."""


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
    """Every image of a stream whose stamp the transforms span, in recorded order, deterministically.

    All transforms are read first, then interpolated at each image's stamp, so nothing depends on the order in
    which images and transforms were recorded. Images before the first or after the last transform are left
    out, and transforms that are none (not finite, no unit quaternion), as the filter's node leaves them out.
    Where the topic is missing, the compressed images beside it are taken. Transforms that are late or repeated are told
    on stderr. Raises InputError if the bag cannot be read, lacks the topic or the transforms, or if the time of a frame
    runs backwards on which the gel's or the true pose depends.
    """
    path, ends = Path(path), (stream.base_frame, stream.gel_frame)
    transforms, refused = recorded_transforms(path, (ends, (TRUTH_FRAME, TRUTH_GEL_FRAME)))
    used, reason = False, "it is empty"
    for message in image_messages(path, stream.image_topic):
        with readable(path):
            stamp = header_stamp_ns(message.data)
        try:
            pose = transforms.lookup(*ends, stamp)
        except TransformError as error:
            reason = "; ".join(filter(None, (str(error), refused)))
            continue
        used = True
        yield BagFrame(stamp, decode_image(message, path), pose, _true_pose(transforms, stamp))
    if not used:
        raise InputError(f"{path}: no image on {stream.image_topic} has a pose ({reason}); record /tf and /tf_static")


def _true_pose(transforms: TransformBuffer, stamp: int) -> np.ndarray | None:
    try:
        return transforms.lookup(TRUTH_FRAME, TRUTH_GEL_FRAME, stamp)
    except TransformError:
        return None
