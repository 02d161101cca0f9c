"""Conversion of ROS messages to NumPy arrays, without ROS.

A message is any object with the attributes of its type, such as those of rclpy or those that rosbags reads from a bag.
Arrays are read-only views of the message where that is possible. The functions raise InputError when the content of a
message contradicts its header.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any

import numpy as np

from . import se3
from .errors import InputError
from .transforms.rigid import Pose

SECOND = 1_000_000_000
"""One second [ns]."""

_LARGEST_POINT = 2**16  # bytes; a NumPy record has a limit, and no sensor's points are larger
_ROUNDING = 1e-6  # tolerance for a probability outside of 0 to 1
_FLOAT32 = 7  # sensor_msgs/PointField
# encoding -> element type, channels
ENCODINGS = {"mono8": (np.uint8, 1), "32FC1": (np.float32, 1)}
# encoding -> channels of red, green and blue
_COLOURS = {"rgb8": [0, 1, 2], "bgr8": [2, 1, 0], "rgba8": [0, 1, 2], "bgra8": [2, 1, 0]}
ENCODINGS |= {name: (np.uint8, 4 if "a" in name else 3) for name in _COLOURS}


def stamp_ns(stamp: Any) -> int:
    """Return a message's time stamp in nanoseconds."""
    return stamp.sec * SECOND + stamp.nanosec


def image_from_msg(msg: Any) -> np.ndarray:
    """Return the pixels (H, W) or (H, W, C) of an image message, read-only; its encoding is one of `ENCODINGS`."""
    if msg.encoding not in ENCODINGS:
        raise InputError(f"image encoding '{msg.encoding}' is not one of {', '.join(ENCODINGS)}")
    kind, channels = ENCODINGS[msg.encoding]
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


def rgb_from_msg(msg: Any, height: int, width: int) -> np.ndarray:
    """Return the pixels of a colour message.

    Parameters
    ----------
    msg
        `Image`.
    height, width : size that it must have [pixels]

    Returns
    -------
    (height, width, 3) uint8 RGB, contiguous

    Raises
    ------
    InputError
        Another encoding or size, or an incomplete image.
    """
    if msg.encoding not in _COLOURS:
        raise InputError(f"image encoding '{msg.encoding}' is not one of {', '.join(_COLOURS)}; publish one of these")
    pixels = image_from_msg(msg)
    if pixels.shape[:2] != (height, width):
        fix = "rotate it to portrait" if pixels.shape[:2] == (width, height) else "let the driver scale its output"
        raise InputError(f"image is {msg.width} x {msg.height} pixels, expected {width} x {height}; {fix}")
    return pixels if msg.encoding == "rgb8" else np.ascontiguousarray(pixels[:, :, _COLOURS[msg.encoding]])


def points_from_msg(msg: Any, names: Sequence[str] = ("x", "y", "z")) -> np.ndarray:
    """Return the points of a cloud, or other float32 fields of it.

    Parameters
    ----------
    msg
        `PointCloud2`.
    names
        The F fields to read; others are ignored.

    Returns
    -------
    (K, F) float32

    Raises
    ------
    InputError
        The cloud lacks a field, does not hold as many bytes as it says, or holds non-finite points.
    """
    if not 0 < msg.point_step <= _LARGEST_POINT or msg.row_step < msg.width * msg.point_step:
        raise InputError(f"cloud with point_step {msg.point_step}, row_step {msg.row_step}, width {msg.width}")
    if len(msg.data) != msg.row_step * msg.height:
        raise InputError(f"cloud says {msg.height} rows of {msg.row_step} bytes but holds {len(msg.data)} bytes")
    order = ">" if msg.is_bigendian else "<"
    offsets = {f.name: f.offset for f in msg.fields if f.datatype == _FLOAT32 and f.count == 1}
    if any(name not in offsets or offsets[name] + 4 > msg.point_step for name in names):
        raise InputError(f"cloud needs fields {', '.join(names)} of type float32 inside its point_step")
    formats, places = [order + "f4"] * len(names), [offsets[name] for name in names]
    layout = np.dtype({"names": list(names), "formats": formats, "offsets": places, "itemsize": msg.point_step})
    rows = np.frombuffer(msg.data, np.uint8).reshape(msg.height, msg.row_step)
    packed = np.ascontiguousarray(rows[:, : msg.width * msg.point_step]).reshape(-1)
    records = packed.view(layout)
    points = np.stack([records[name] for name in names], axis=1).astype(np.float32, copy=False)
    if not np.isfinite(points).all():
        raise InputError("cloud holds non-finite points")
    return points


def point_from_msg(point: Any) -> np.ndarray:
    """Return [x y z] (3,) m of a point message, unchecked."""
    return np.array((point.x, point.y, point.z))


def poses_from_msgs(poses: Sequence[Any]) -> np.ndarray:
    """Return the transforms (N, 4, 4) of pose messages; InputError on a zero quaternion or a non-finite value."""
    rows = [_xyzquat(pose.position, pose.orientation) for pose in poses]
    return se3.from_xyzquat(np.array(rows).reshape(-1, 7))


def pose_from_msg(pose: Any) -> np.ndarray:
    """Return the transform (4, 4) of a pose message; InputError as in `poses_from_msgs`."""
    return poses_from_msgs([pose])[0]


def xyzquat_from_msg(transform: Any) -> Pose:
    """Return [x y z qx qy qz qw] of a transform message, position in m, unchecked."""
    return _xyzquat(transform.translation, transform.rotation)


def transform_from_msg(transform: Any) -> np.ndarray:
    """Return the transform (4, 4) of a transform message; InputError as in `poses_from_msgs`."""
    return se3.from_xyzquat(xyzquat_from_msg(transform))


def _xyzquat(p: Any, q: Any) -> Pose:
    return p.x, p.y, p.z, q.x, q.y, q.z, q.w


def covariance_from_msg(covariance: np.ndarray) -> np.ndarray:
    """Return a field as covariance (6, 6), REP 103 order; InputError if not finite or if a variance is negative."""
    matrix = np.asarray(covariance, float).reshape(6, 6)
    if not np.isfinite(matrix).all() or (np.diagonal(matrix) < 0).any():
        raise InputError("covariance with a non-finite value or a negative variance")
    return matrix


def probabilities_from_msg(msg: Any) -> dict[str, float]:
    """Return the probability of each object of a `Detection3DArray`, by the object's name.

    Raises InputError for a detection without a hypothesis, or with a score that is no probability."""
    if not all(each.results for each in msg.detections):
        raise InputError("a detection has no hypothesis: results is empty")
    found = [each.results[0].hypothesis for each in msg.detections]
    if not all(-_ROUNDING <= each.score <= 1.0 + _ROUNDING for each in found):
        raise InputError("the score of a hypothesis is no probability: outside of 0 to 1, or not finite")
    return {each.class_id: float(each.score) for each in found}
