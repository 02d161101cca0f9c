"""Transforms as messages, for tests of several packages."""

from __future__ import annotations

import numpy as np
from geometry_msgs.msg import TransformStamped
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from midastouch_common import se3
from midastouch_common.ros.conversions import stamp_from_ns, transform_to_msg


def translation(x: float, y: float = 0.0, z: float = 0.0) -> np.ndarray:
    return se3.translation([x, y, z])


def tf_msg(stamp: int, pose: np.ndarray, parent: str = "base_link", child: str = "digit_gel_frame") -> TFMessage:
    header = Header(stamp=stamp_from_ns(stamp), frame_id=parent)
    transform = transform_to_msg(pose)
    return TFMessage(transforms=[TransformStamped(header=header, child_frame_id=child, transform=transform)])
