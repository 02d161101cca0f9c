"""Conversion of NumPy arrays to ROS messages (`message_arrays` is the way back).

Bulk data goes into messages as `array.array`: rclpy checks plain bytes and lists element by element, which is
30-100 times slower.
"""

from __future__ import annotations

import array
import sys

import numpy as np
import numpy.typing as npt
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion, Transform, TransformStamped, Vector3
from sensor_msgs.msg import Image, PointCloud2, PointField
from std_msgs.msg import Header

from .. import se3
from ..message_arrays import ENCODINGS, SECOND


def stamp_from_ns(nanoseconds: int) -> Time:
    """Return nanoseconds as a message's time stamp, clamped to the range of a message (up to the year 2038)."""
    sec = min(max(nanoseconds // SECOND, -(2**31)), 2**31 - 1)
    return Time(sec=sec, nanosec=nanoseconds % SECOND)


def image_to_msg(pixels: np.ndarray, encoding: str, header: Header) -> Image:
    """Return the image message of pixels (H, W) or (H, W, C); ValueError if they do not fit the encoding."""
    kind, channels = ENCODINGS[encoding]
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


def points_to_msg(points: np.ndarray, header: Header, **extra: np.ndarray) -> PointCloud2:
    """Return an unorganised cloud of points (K, 3), metres, with further float32 fields (K,) by name."""
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
    """Return the pose messages of transforms (N, 4, 4)."""
    return [
        Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion(x=qx, y=qy, z=qz, w=qw))
        for x, y, z, qx, qy, qz, qw in se3.to_xyzquat(transforms).tolist()
    ]


def pose_to_msg(transform: np.ndarray) -> Pose:
    """Return the pose message of a transform (4, 4)."""
    return poses_to_msgs(transform[None])[0]


def stamped_pose(frame: str, transform: np.ndarray, stamp: Time | None = None) -> PoseStamped:
    """Return a transform (4, 4) as a stamped pose in a frame."""
    return PoseStamped(header=Header(stamp=stamp or Time(), frame_id=frame), pose=pose_to_msg(transform))


def transform_to_msg(transform: np.ndarray) -> Transform:
    """Return the transform message of a transform (4, 4)."""
    x, y, z, qx, qy, qz, qw = se3.to_xyzquat(transform).tolist()
    return Transform(translation=Vector3(x=x, y=y, z=z), rotation=Quaternion(x=qx, y=qy, z=qz, w=qw))


def stamped_transform(stamp: Time, parent: str, child: str, transform: np.ndarray) -> TransformStamped:
    """Return the message for TF that places frame `child` in frame `parent`: T_parent_child (4, 4)."""
    header = Header(stamp=stamp, frame_id=parent)
    return TransformStamped(header=header, child_frame_id=child, transform=transform_to_msg(transform))


def float32_to_msg(values: npt.ArrayLike) -> array.array:
    """Return the values as a float32[] field."""
    return array.array("f", np.ascontiguousarray(values, np.float32).tobytes())
