"""An engine for `digit_sim`: puts the gel somewhere on an object and says so on TF."""

from __future__ import annotations

import numpy as np
from ros_graph import RosGraph
from sensor_msgs.msg import Image
from tf2_msgs.msg import TFMessage
from tf_messages import tf_msg

from midastouch_common.frames import GEL_FRAME, TRUTH_FRAME
from midastouch_common.message_arrays import ENCODINGS
from midastouch_common.ros import qos

PERIOD = 1 / 60
"""s between two images."""
BASE_FROM_OBJECT = np.eye(4)
BASE_FROM_OBJECT[:3, 3] = 0.4, -0.1, 0.2


class Engine:
    """Publishes on a graph; `stamp` [ns] is its time."""

    def __init__(self, graph: RosGraph, stamp: int = 5_000_000_000):
        self._tf = graph.publisher(TFMessage, "/tf", qos.TF)
        self.stamp = stamp

    def place(self, T_obj_gel: np.ndarray, seconds: float = 0.0) -> None:
        """The gel is at T_obj_gel (4, 4), so many seconds later."""
        self.stamp += round(1e9 * seconds)
        for frame, pose in ((TRUTH_FRAME, BASE_FROM_OBJECT), (GEL_FRAME, BASE_FROM_OBJECT @ T_obj_gel)):
            self._tf.publish(tf_msg(self.stamp, pose, child=frame))


def penetration(message: Image) -> np.ndarray:
    """The map (H, W) m in a message."""
    assert message.encoding == "32FC1"
    return np.frombuffer(message.data, ENCODINGS["32FC1"][0]).reshape(message.height, message.width)
