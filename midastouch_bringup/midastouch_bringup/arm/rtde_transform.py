"""What a Universal Robots controller says about its tool, as transforms.

RTDE gives poses as [x y z rx ry rz]: metres and a rotation vector (axis times angle, radians) of the tool
centre point (TCP) in the frame `base`, the one of the teach pendant. URDF's `base_link` is that frame turned
by pi about z; `tool0` is the TCP of an arm on which no TCP offset is set.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from midastouch_common import se3
from midastouch_common.errors import InputError

#: T_base_link_base, a constant of every UR arm (Universal_Robots_ROS2_Description, `ur_macro.xacro`).
BASE_LINK_FROM_BASE = np.diag([-1.0, -1.0, 1.0, 1.0])

#: Names of the joints in the order of RTDE's `actual_q`.
JOINT_NAMES = (
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
)


def transform_from_rtde(pose: np.ndarray) -> np.ndarray:
    """Transforms (..., 4, 4) from RTDE poses (..., 6) [x y z rx ry rz], metres and radians.

    Raises InputError on another shape and on non-finite values.
    """
    pose = np.asarray(pose, float)
    if pose.shape[-1:] != (6,):
        raise InputError(f"an RTDE pose has 6 values [x y z rx ry rz], got shape {pose.shape}")
    if not np.isfinite(pose).all():
        raise InputError("RTDE pose with a non-finite value; is the arm powered on and its controller ready?")
    flat = pose.reshape(-1, 6)
    rotation = Rotation.from_rotvec(flat[:, 3:]).as_matrix()
    return se3.make(rotation, flat[:, :3]).reshape((*pose.shape[:-1], 4, 4))


def tool_from_tcp(tcp_pose: np.ndarray, tcp_offset: np.ndarray) -> np.ndarray:
    """T_base_tool0 (..., 4, 4) from `actual_TCP_pose` (..., 6) and the TCP set on the teach pendant (6,).

    `tcp_offset` is T_tool0_tcp, written as the pendant writes it: [x y z rx ry rz], metres and radians.
    """
    return transform_from_rtde(tcp_pose) @ se3.inverse(transform_from_rtde(tcp_offset))
