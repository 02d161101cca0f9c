"""ROS messages <-> NumPy arrays.

Bulk data goes into messages as `array.array`: rclpy checks plain bytes and lists element by element, which is
30-100 times slower. Arrays made from messages are read-only views of the message where that is possible.
Every `*_from_msg` function raises InputError when the message does not hold what it says.
"""

from __future__ import annotations

import array
import sys
from collections.abc import Sequence

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Pose, Quaternion, Transform, Vector3
from sensor_msgs.msg import Image, PointCloud2, PointField
from std_msgs.msg import Header

from .. import se3
from ..errors import InputError

_LARGEST_POINT = 2**16  # bytes; a NumPy record has a limit, and no sensor's points are larger
# encoding -> element type, channels
_ENCODINGS = {"rgb8": (np.uint8, 3), "bgr8": (np.uint8, 3), "mono8": (np.uint8, 1), "32FC1": (np.float32, 1)}


def stamp_ns(stamp: Time) -> int:
    """A message's time stamp in nanoseconds."""
    return stamp.sec * 1_000_000_000 + stamp.nanosec


def stamp_from_ns(nanoseconds: int) -> Time:
    """Nanoseconds as a message's time stamp; the nearest one that a message can hold (up to the year 2038)."""
    sec = min(max(nanoseconds // 1_000_000_000, -(2**31)), 2**31 - 1)
    return Time(sec=sec, nanosec=nanoseconds % 1_000_000_000)


def image_from_msg(msg: Image) -> np.ndarray:
    """Pixels (H, W) or (H, W, C) of an image message, read-only; rgb8, bgr8, mono8 and 32FC1 are known."""
    if msg.encoding not in _ENCODINGS:
        raise InputError(f"image encoding '{msg.encoding}' is not one of {', '.join(_ENCODINGS)}")
    kind, channels = _ENCODINGS[msg.encoding]
    row = msg.width * channels * np.dtype(kind).itemsize
    if msg.height == 0 or msg.width == 0:
        raise InputError(f"image of {msg.width} x {msg.height} pixels is empty")
    if msg.step < row or len(msg.data) != msg.step * msg.height:
        raise InputError(
            f"image says {msg.width} x {msg.height} {msg.encoding}, step {msg.step}, but holds {len(msg.data)} bytes"
        )
    rows = np.frombuffer(msg.data, np.uint8).reshape(msg.height, msg.step)[:, :row]
    pixels = np.ascontiguousarray(rows).view(kind)
    if np.dtype(kind).itemsize > 1 and bool(msg.is_bigendian) != (sys.byteorder == "big"):
        pixels = pixels.byteswap()
    pixels = pixels.reshape((msg.height, msg.width) if channels == 1 else (msg.height, msg.width, channels))
    pixels.flags.writeable = False
    return pixels


def rgb_from_msg(msg: Image, height: int, width: int) -> np.ndarray:
    """Colour image (height, width, 3) uint8 RGB, contiguous, from an rgb8 or bgr8 message of that size."""
    if msg.encoding not in ("rgb8", "bgr8"):
        raise InputError(f"image encoding '{msg.encoding}' is not colour; publish rgb8 or bgr8")
    pixels = image_from_msg(msg)
    if pixels.shape[:2] != (height, width):
        turn = "; rotate it to portrait" if pixels.shape[:2] == (width, height) else ""
        raise InputError(f"image is {msg.width} x {msg.height} pixels, expected {width} x {height}{turn}")
    return np.ascontiguousarray(pixels[:, :, ::-1]) if msg.encoding == "bgr8" else pixels


def image_to_msg(pixels: np.ndarray, encoding: str, header: Header) -> Image:
    """Image message of pixels (H, W) or (H, W, C) of the encoding's element type."""
    kind, channels = _ENCODINGS[encoding]
    height, width = pixels.shape[:2]
    if pixels.dtype != kind or pixels.size != height * width * channels:
        raise ValueError(f"{pixels.dtype} array of shape {pixels.shape} is not {encoding}")
    return Image(
        header=header,
        height=height,
        width=width,
        encoding=encoding,
        is_bigendian=int(sys.byteorder == "big"),
        step=width * channels * np.dtype(kind).itemsize,
        data=array.array("B", np.ascontiguousarray(pixels).tobytes()),
    )


def points_from_msg(msg: PointCloud2, names: Sequence[str] = ("x", "y", "z")) -> np.ndarray:
    """Points (K, 3), or what else `names` asks for (K, F), of a cloud's float32 fields; others are passed over."""
    if not 0 < msg.point_step <= _LARGEST_POINT or msg.row_step < msg.width * msg.point_step:
        raise InputError(f"cloud with point_step {msg.point_step}, row_step {msg.row_step}, width {msg.width}")
    if len(msg.data) != msg.row_step * msg.height:
        raise InputError(f"cloud says {msg.height} rows of {msg.row_step} bytes but holds {len(msg.data)} bytes")
    order = ">" if msg.is_bigendian else "<"
    offsets = {f.name: f.offset for f in msg.fields if f.datatype == PointField.FLOAT32 and f.count == 1}
    if any(name not in offsets or offsets[name] + 4 > msg.point_step for name in names):
        raise InputError(f"cloud needs fields {', '.join(names)} of type float32 inside its point_step")
    layout = np.dtype(
        {
            "names": list(names),
            "formats": [order + "f4"] * len(names),
            "offsets": [offsets[name] for name in names],
            "itemsize": msg.point_step,
        }
    )
    rows = np.frombuffer(msg.data, np.uint8).reshape(msg.height, msg.row_step)
    packed = np.ascontiguousarray(rows[:, : msg.width * msg.point_step]).reshape(-1)
    records = packed.view(layout)
    points = np.stack([records[name] for name in names], axis=1).astype(np.float32, copy=False)
    if not np.isfinite(points).all():
        raise InputError("cloud holds non-finite points")
    return points


def points_to_msg(points: np.ndarray, header: Header, **extra: np.ndarray) -> PointCloud2:
    """Unorganised cloud of points (K, 3), metres, with further float32 fields (K,) by name."""
    columns = np.column_stack([points.reshape(-1, 3), *extra.values()]).astype("<f4")
    step = 4 * columns.shape[1]
    names = ["x", "y", "z", *extra]
    return PointCloud2(
        header=header,
        height=1,
        width=len(columns),
        fields=[
            PointField(name=name, offset=4 * i, datatype=PointField.FLOAT32, count=1) for i, name in enumerate(names)
        ],
        is_bigendian=False,
        point_step=step,
        row_step=step * len(columns),
        data=array.array("B", columns.tobytes()),
        is_dense=bool(np.isfinite(columns).all()),
    )


def poses_to_msgs(transforms: np.ndarray) -> list[Pose]:
    """Pose messages of transforms (N, 4, 4)."""
    return [
        Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion(x=qx, y=qy, z=qz, w=qw))
        for x, y, z, qx, qy, qz, qw in se3.to_xyzquat(transforms).tolist()
    ]


def pose_to_msg(transform: np.ndarray) -> Pose:
    """Pose message of a transform (4, 4)."""
    return poses_to_msgs(transform[None])[0]


def pose_from_msg(pose: Pose) -> np.ndarray:
    """Transform (4, 4) of a pose message; InputError on a zero quaternion or a non-finite value."""
    p, q = pose.position, pose.orientation
    return se3.from_xyzquat(np.array([p.x, p.y, p.z, q.x, q.y, q.z, q.w]))


def transform_to_msg(transform: np.ndarray) -> Transform:
    """Transform message of a transform (4, 4)."""
    x, y, z, qx, qy, qz, qw = se3.to_xyzquat(transform).tolist()
    return Transform(translation=Vector3(x=x, y=y, z=z), rotation=Quaternion(x=qx, y=qy, z=qz, w=qw))


def transform_from_msg(transform: Transform) -> np.ndarray:
    """Transform (4, 4) of a transform message; InputError as `pose_from_msg`."""
    p, q = transform.translation, transform.rotation
    return se3.from_xyzquat(np.array([p.x, p.y, p.z, q.x, q.y, q.z, q.w]))


def covariance_from_msg(covariance: np.ndarray) -> np.ndarray:
    """Covariance (6, 6), REP 103 order, of its field; InputError if not finite or a variance is negative."""
    matrix = np.asarray(covariance, float).reshape(6, 6)
    if not np.isfinite(matrix).all() or (np.diagonal(matrix) < 0).any():
        raise InputError("covariance with a non-finite value or a negative variance")
    return matrix


def float32_to_msg(values: np.ndarray) -> array.array:
    """A float32[] field."""
    return array.array("f", np.ascontiguousarray(values, np.float32).tobytes())
