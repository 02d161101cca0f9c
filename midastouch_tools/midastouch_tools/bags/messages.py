"""A sequence as ROS messages: the same bytes go into a bag and onto the wire; making them needs no ROS.

Frames. A sequence has no real arm: its `base_link` is the object's frame shifted by a fixed offset, so that code that
confuses the two gets visibly wrong poses. `base_link -> digit_gel_frame` comes from the *measured* poses; the truth
has frames of its own, `object_ground_truth -> digit_gel_ground_truth`, for displays and evaluation.
"""

from __future__ import annotations

import functools
import os
import struct
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.frames import (
    BASE_FRAME,
    BASE_FROM_OBJECT,
    GEL_FRAME,
    OPTICAL_FRAME,
    TRUTH_FRAME,
    TRUTH_GEL_FRAME,
)
from midastouch_common.message_arrays import SECOND
from midastouch_perception.sensor_model import SensorModel

from ..datasets import Sequence
from ..datasets.plain_images import PlainImages

IMAGE_TOPIC = "/image_raw"
COMPRESSED_TOPIC = f"{IMAGE_TOPIC}/compressed"
CAMERA_INFO_TOPIC = "/camera_info"
TF_TOPIC = "/tf"
TF_STATIC_TOPIC = "/tf_static"

IMAGE_TYPE = "sensor_msgs/msg/Image"
COMPRESSED_TYPE = "sensor_msgs/msg/CompressedImage"
TF_TYPE = "tf2_msgs/msg/TFMessage"


@dataclass(frozen=True)
class Topic:
    """A topic: name, type such as `std_msgs/msg/String`, and `latched`: late subscribers get its last message."""

    name: str
    type_name: str
    latched: bool = False


@dataclass(frozen=True)
class Message:
    """One serialised message.

    topic: its name; type_name: such as `sensor_msgs/msg/Image`; stamp_ns: time at which it was (or would have been)
    recorded; data: CDR bytes with the encapsulation header; latched: True if late subscribers get it.
    """

    topic: str
    type_name: str
    stamp_ns: int
    data: bytes
    latched: bool = False

    @classmethod
    def of(cls, topic: str, content: Any, stamp_ns: int, latched: bool = False) -> Message:
        """Return the message that says `content`, an object of the type store."""
        type_name = content.__msgtype__
        return cls(topic, type_name, stamp_ns, bytes(typestore().serialize_cdr(content, type_name)), latched)

    @property
    def content(self) -> Any:
        """What it says, as an object of the type store."""
        return typestore().deserialize_cdr(self.data, self.type_name)


SEQUENCE_TOPICS = (
    Topic(TF_STATIC_TOPIC, TF_TYPE, latched=True),
    Topic(TF_TOPIC, TF_TYPE),
    Topic(CAMERA_INFO_TOPIC, "sensor_msgs/msg/CameraInfo"),
    Topic(IMAGE_TOPIC, IMAGE_TYPE),
)
"""Topics of `sequence_messages`."""

PLAIN_IMAGE_TOPICS = SEQUENCE_TOPICS[2:]
"""Topics of `plain_image_messages`."""


@functools.cache
def typestore() -> Typestore:
    """The message types of ROS 2 Jazzy and those of `midastouch_msgs` and `vision_msgs`.

    Raises InputError if one of these is not installed.
    """
    store = get_typestore(Stores.ROS2_JAZZY)
    for package in "midastouch_msgs", "vision_msgs":
        for file in sorted(_message_folder(package).glob("*.msg")):
            store.register(get_types_from_msg(file.read_text(), f"{package}/msg/{file.stem}"))
    return store


def _message_folder(package: str) -> Path:
    """Folder of a package's .msg files, in a sourced workspace or in this environment."""
    prefixes = [*os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep), sys.prefix]
    for prefix in filter(None, prefixes):
        folder = Path(prefix) / "share" / package / "msg"
        if folder.is_dir():
            return folder
    raise InputError(f"{package} is not installed; build the workspace and source it, or run make")


def header_stamp_ns(data: bytes) -> int:
    """Stamp [ns] of a serialised message that starts with a header, without deserialising it."""
    order = "<" if data[1] & 1 else ">"
    seconds, nanoseconds = struct.unpack_from(f"{order}iI", data, 4)
    return seconds * SECOND + nanoseconds


def sequence_messages(sequence: Sequence, offset_ns: int = 0) -> Iterator[Message]:
    """Yield all messages of a sequence in order of time; at equal stamps the transform comes first, the image last.

    Frames of the first `offset_ns` are left out, and their images are not read.
    """
    stamps = sequence.stamps_ns.tolist()
    measured = BASE_FROM_OBJECT @ sequence.poses_measured
    yield _static_transforms(stamps[0])
    for i, stamp in enumerate(stamps):
        if stamp < stamps[0] + offset_ns:
            continue
        transforms = [
            _transform(stamp, BASE_FRAME, GEL_FRAME, measured[i]),
            _transform(stamp, TRUTH_FRAME, TRUTH_GEL_FRAME, sequence.poses_true[i]),
        ]
        yield Message.of(TF_TOPIC, new_message(TF_TYPE, transforms=transforms), stamp)
        yield from _camera_messages(stamp, sequence.image(i))


def plain_image_messages(images: PlainImages, offset_ns: int = 0) -> Iterator[Message]:
    """Yield camera info and image of each frame, without those of the first `offset_ns`; there are no poses."""
    for stamp, pixels in images.frames(offset_ns):
        yield from _camera_messages(stamp, pixels)


def new_message(type_name: str, **given: Any) -> Any:
    """Return a message of the type store; fields that are not given are zero or empty."""
    store = typestore()
    fields = store.fielddefs[type_name][1]
    return store.types[type_name](**{name: given[name] if name in given else _empty(*kind) for name, kind in fields})


def _empty(node: Nodetype, kind: Any) -> Any:
    if node == Nodetype.NAME:
        return new_message(kind)
    if node == Nodetype.BASE:
        return {"string": "", "bool": False, "float64": 0.0}.get(kind[0], 0)
    (element, of), count = kind
    return [] if element == Nodetype.NAME or of[0] == "string" else np.zeros(count, of[0])


def header(stamp_ns: int, frame: str) -> Any:
    """Return a `std_msgs/msg/Header` of the type store."""
    stamp = new_message("builtin_interfaces/msg/Time", sec=stamp_ns // SECOND, nanosec=stamp_ns % SECOND)
    return new_message("std_msgs/msg/Header", stamp=stamp, frame_id=frame)


def _transform(stamp: int, parent: str, child: str, transform: np.ndarray) -> Any:
    x, y, z, *quaternion = se3.to_xyzquat(transform).tolist()
    moved = new_message("geometry_msgs/msg/Vector3", x=x, y=y, z=z)
    turned = new_message("geometry_msgs/msg/Quaternion", **dict(zip("xyzw", quaternion, strict=True)))
    placed = new_message("geometry_msgs/msg/Transform", translation=moved, rotation=turned)
    about = header(stamp, parent)
    return new_message("geometry_msgs/msg/TransformStamped", header=about, child_frame_id=child, transform=placed)


def _static_transforms(stamp: int) -> Message:
    """The camera on the gel (its optical frame looks along -z of the gel frame) and the true object."""
    looking_down = se3.exp(np.array([0, 0, 0, np.pi, 0, 0]))[:3, :3]
    distance = SensorModel.load("digit_tacto").gel_distance
    transforms = [
        _transform(stamp, GEL_FRAME, OPTICAL_FRAME, se3.make(looking_down, np.array([0, 0, distance]))),
        _transform(stamp, BASE_FRAME, TRUTH_FRAME, BASE_FROM_OBJECT),
    ]
    return Message.of(TF_STATIC_TOPIC, new_message(TF_TYPE, transforms=transforms), stamp, latched=True)


def image_message(header: Any, pixels: np.ndarray, stamp_ns: int) -> Message:
    """Return a tactile image of pixels (H, W, 3) uint8 RGB; header: a `std_msgs/msg/Header` of the type store."""
    height, width, channels = pixels.shape
    content = new_message(
        IMAGE_TYPE,
        header=header,
        height=height,
        width=width,
        encoding="rgb8",
        step=width * channels,
        data=pixels.reshape(-1),
    )
    return Message.of(IMAGE_TOPIC, content, stamp_ns)


def _camera_messages(stamp_ns: int, pixels: np.ndarray) -> list[Message]:
    """Return camera info, with the size only (K[0] = 0: not calibrated, as a DIGIT is not), and image (320, 240, 3)."""
    about = header(stamp_ns, OPTICAL_FRAME)
    camera_info = new_message("sensor_msgs/msg/CameraInfo", header=about, height=320, width=240)
    return [Message.of(CAMERA_INFO_TOPIC, camera_info, stamp_ns), image_message(about, pixels, stamp_ns)]
