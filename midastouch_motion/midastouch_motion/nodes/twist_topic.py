"""Twists and wrenches as messages, and the nodes on the topic of twists."""

from __future__ import annotations

import numpy as np
from geometry_msgs.msg import TwistStamped, Vector3
from rclpy.node import Node

_NO_ARMS = "recorder", "rosbag2_recorder", "_ros2cli"  # first parts of the names of nodes that only read twists


def twist_of(msg: TwistStamped) -> np.ndarray:
    """Return the twist (6,) of a message: [v, omega], m/s and rad/s."""
    return np.array([getattr(each, axis) for each in (msg.twist.linear, msg.twist.angular) for axis in "xyz"])


def vectors(six: np.ndarray) -> tuple[Vector3, Vector3]:
    """Return the two halves of a twist or a wrench (6,)."""
    first, second = (Vector3(**dict(zip("xyz", half, strict=True))) for half in six.reshape(2, 3).tolist())
    return first, second


def followers_and_commanders(node: Node, topic: str) -> tuple[int, int]:
    """Return the numbers of the nodes that follow twists on a topic, and of those that publish them."""
    readers = (info.node_name for info in node.get_subscriptions_info_by_topic(topic))
    return sum(not reader.startswith(_NO_ARMS) for reader in readers), node.count_publishers(topic)
