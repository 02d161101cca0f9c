"""Time of a simulated sensor: as fast as the filter follows, however slow the machine is."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterable

import numpy as np
from rclpy.node import Node
from tf2_msgs.msg import TFMessage

from midastouch_common.frames import BASE_FRAME, TRUTH_FRAME
from midastouch_common.message_arrays import SECOND, stamp_ns
from midastouch_common.ros import qos
from midastouch_common.ros.conversions import stamp_from_ns, stamped_transform
from midastouch_common.ros.parameters import Parameter
from midastouch_msgs.msg import FilterStatus

PARAMETERS = (
    Parameter("mesh", "", "Mesh of the object, metres: a path or package://NAME/...; must be given"),
    Parameter("sensor_model", "digit_tacto", "Geometry of the sensor, as of digit_sim"),
    Parameter("seed", 0, "Of all that is drawn at random", minimum=0, maximum=2**31 - 1),
    Parameter("fps", 30.0, "As of digit_sim: one pose per image", minimum=1.0, maximum=240.0),
    Parameter(
        "untouched_frames",
        32,
        "Images of the untouched sensor before it moves: as many as tdn estimates its background from",
        minimum=1,
        maximum=1000,
    ),
    Parameter("base_frame_id", BASE_FRAME, "Frame in which the arm stands"),
    Parameter("object_frame_id", TRUTH_FRAME, "Frame of the object where it really is, as of digit_sim"),
)
"""Of nodes that move a simulated sensor at the pace of the filter."""
AT_REST_S = 1.0  # between images while nothing moves: the last may be lost, and the filter would turn stale
_IN_FLIGHT = 3  # most images without an answer; digit_sim leaves some out when more are due at once


class Pace:
    """Publisher of TF whose time advances by one image, 1 / `fps` s, with each `publish`.

    Attributes: stamp [ns]: of the newest image; awaited: stamps without an answer, in order.
    """

    def __init__(self, node: Node, fps: float):
        self._publisher = node.create_publisher(TFMessage, "/tf", qos.TF)
        self._period = round(SECOND / fps)
        self.stamp, self._moved_at = time.time_ns(), time.monotonic()
        self.awaited: deque[int] = deque()

    @property
    def free(self) -> bool:
        """True while another image may be sent."""
        return len(self.awaited) < _IN_FLIGHT

    @property
    def at_rest(self) -> bool:
        """True once nothing has been published for a while."""
        return time.monotonic() - self._moved_at > AT_REST_S

    def publish(self, transforms: Iterable[tuple[str, str, np.ndarray]]) -> None:
        """Publish transforms, each (parent, child, (4, 4)), with the stamp of the next image."""
        self.stamp += self._period
        self._moved_at = time.monotonic()
        self.awaited.append(self.stamp)
        stamp = stamp_from_ns(self.stamp)
        self._publisher.publish(TFMessage(transforms=[stamped_transform(stamp, *each) for each in transforms]))

    def answered(self, status: FilterStatus) -> bool:
        """Return whether a status answers an awaited image; it and those before it, now lost, are awaited no more."""
        stamp = stamp_ns(status.header.stamp)
        if status.state == FilterStatus.STATE_WAITING or stamp not in self.awaited:
            return False
        while self.awaited and self.awaited[0] <= stamp:
            self.awaited.popleft()
        return True
