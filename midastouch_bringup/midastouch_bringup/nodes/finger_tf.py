"""A simulated finger as others see it: on TF, one image's time after the other."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Mapping

import numpy as np
from geometry_msgs.msg import TransformStamped
from rclpy.node import Node
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from midastouch_common.ros import qos
from midastouch_common.ros.conversions import stamp_from_ns, transform_to_msg
from midastouch_filter.transforms import SECOND

from ..bags.messages import TRUTH_GEL_FRAME
from ..explore.world import World


class FingerTf:
    """The time of the finger is its own: it goes on by one image, 1 / `fps` s, with each `publish`.

    Attributes: stamp [ns] of the newest; awaited, the stamps in order that nobody has answered; moved_at [s], when it
    last went on, by a clock that never stops.
    Args: frames, the names of `base`, `object` and `sensor`.
    """

    def __init__(self, node: Node, world: World, fps: float, frames: Mapping[str, str]):
        self._publisher = node.create_publisher(TFMessage, "/tf", qos.TF)
        self._world, self._frames, self._period = world, frames, round(SECOND / fps)
        self.stamp, self.moved_at = time.time_ns(), time.monotonic()
        self.awaited: deque[int] = deque()

    def publish(self) -> None:
        """Finger and object as they are now, one image later."""
        self.stamp += self._period
        self.moved_at = time.monotonic()
        self.awaited.append(self.stamp)
        world, frames = self._world, self._frames
        transforms = [
            self._transform(frames["base"], frames["object"], world.base_from_object),
            self._transform(frames["base"], frames["sensor"], world.base_from_gel),
            self._transform(frames["object"], TRUTH_GEL_FRAME, world.finger.pose),
        ]
        self._publisher.publish(TFMessage(transforms=transforms))

    def answered(self, stamp: int) -> bool:
        """Whether the image of a stamp [ns] was awaited; no longer, nor are those before it, which are lost."""
        if stamp not in self.awaited:
            return False
        while self.awaited and self.awaited[0] <= stamp:
            self.awaited.popleft()
        return True

    def _transform(self, parent: str, child: str, pose: np.ndarray) -> TransformStamped:
        header = Header(stamp=stamp_from_ns(self.stamp), frame_id=parent)
        return TransformStamped(header=header, child_frame_id=child, transform=transform_to_msg(pose))
