"""The penetration map that belongs to a code: from the cloud of the same image."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable

import numpy as np
from rclpy.node import Node
from sensor_msgs.msg import PointCloud2

from midastouch_common.errors import InputError
from midastouch_common.message_arrays import points_from_msg, stamp_ns
from midastouch_common.ros import qos
from midastouch_perception.pointcloud import penetration_from_cloud
from midastouch_perception.sensor_model import SensorModel

from ..core.touch import reduced_penetration

# The code is made from the cloud, so that a cloud comes first or, overtaken, at once; else it was lost.
PATIENCE = 0.25
"""s of waiting where messages may be lost."""
_RELIABLE_PATIENCE = 5.0  # s; where none is lost, a busy machine is all that is waited for
# Clouds that wait with codes whose transforms are late: over 4 s at 60 Hz.
_KEPT = 256


class MapSource:
    """Keeps the last clouds until their code asks for them.

    on_cloud: called after every cloud, so that whoever waits can ask again. on_bad: called with a reason for each
    cloud that cannot be used. Nothing is waited for while nobody publishes clouds: the filter does without.
    """

    def __init__(
        self,
        node: Node,
        depth: int,
        reliable: bool,
        on_cloud: Callable[[], None],
        on_bad: Callable[[str], None],
        topic: str = "tactile/points",
    ):
        self._topic = topic
        self._patience = _RELIABLE_PATIENCE if reliable else PATIENCE
        self._node, self._on_cloud, self._on_bad = node, on_cloud, on_bad
        self._clouds: OrderedDict[int, PointCloud2] = OrderedDict()
        # Live a code waits alone, but the clouds of its successors may already be there.
        profile = qos.stage_subscriber(max(depth, 10), reliable)
        node.create_subscription(PointCloud2, topic, self._on_points, profile)

    def awaited(self, stamp: int, waited: float) -> bool:
        """Whether the cloud of `stamp` [ns] is still to come, when whoever asks has `waited` seconds for it.

        Clouds come in order: one whose successor is there was lost.
        """
        if waited >= self._patience or stamp in self._clouds:
            return False
        if self._clouds and next(reversed(self._clouds)) > stamp:
            return False
        return self._node.count_publishers(self._topic) > 0

    def take(self, stamp: int, sensor: SensorModel) -> np.ndarray | None:
        """Penetration map (80, 60) float32 m at `stamp` [ns], `sensor` at map resolution; None if its cloud is lost.

        What is older is forgotten: codes are answered in order.
        """
        cloud = self._clouds.pop(stamp, None)
        while self._clouds and next(iter(self._clouds)) < stamp:
            self._clouds.popitem(last=False)
        if cloud is None:
            return None
        try:
            return reduced_penetration(penetration_from_cloud(points_from_msg(cloud), sensor))
        except InputError as error:
            self._on_bad(f"{self._topic}: {error}")
            return None

    def _on_points(self, msg: PointCloud2) -> None:
        stamp = stamp_ns(msg.header.stamp)
        if self._clouds and stamp < next(reversed(self._clouds)):
            self._clouds.clear()  # time ran backwards: a looped bag
        self._clouds[stamp] = msg
        while len(self._clouds) > _KEPT:
            self._clouds.popitem(last=False)
        self._on_cloud()
