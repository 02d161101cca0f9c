"""Publisher of a simulated finger on TF, in time steps of one image."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Mapping

from rclpy.node import Node
from tf2_msgs.msg import TFMessage

from midastouch_common.frames import TRUTH_GEL_FRAME
from midastouch_common.message_arrays import SECOND
from midastouch_common.ros import qos
from midastouch_common.ros.conversions import stamp_from_ns, stamped_transform

from ..world import World


class FingerTf:
    """TF of the finger, with a time of its own that advances by one image, 1 / `fps` s, with each `publish`.

    Attributes: stamp [ns]: of the newest image; awaited: stamps without an answer, in order; moved_at [s]: time of the
    last `publish` on the monotonic clock.
    Args: frames: names of `base`, `object` and `sensor`.
    """

    def __init__(self, node: Node, world: World, fps: float, frames: Mapping[str, str]):
        self._publisher = node.create_publisher(TFMessage, "/tf", qos.TF)
        self._world, self._frames, self._period = world, frames, round(SECOND / fps)
        self.stamp, self.moved_at = time.time_ns(), time.monotonic()
        self.awaited: deque[int] = deque()

    def publish(self) -> None:
        """Publish finger and object as they are now, with the stamp of the next image."""
        self.stamp += self._period
        self.moved_at = time.monotonic()
        self.awaited.append(self.stamp)
        world, frames = self._world, self._frames
        poses = (
            (frames["base"], frames["object"], world.base_from_object),
            (frames["base"], frames["sensor"], world.base_from_gel),
            (frames["object"], TRUTH_GEL_FRAME, world.finger.pose),
        )
        stamp = stamp_from_ns(self.stamp)
        self._publisher.publish(TFMessage(transforms=[stamped_transform(stamp, *each) for each in poses]))

    def answered(self, stamp: int) -> bool:
        """Return whether the image of a stamp [ns] was awaited; it and those before it, now lost, no longer are."""
        if stamp not in self.awaited:
            return False
        while self.awaited and self.awaited[0] <= stamp:
            self.awaited.popleft()
        return True
