"""Node `recorder`: writes topics into an MCAP bag, for machines whose ROS comes without rosbag2."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Sequence

from rclpy.node import Node

from midastouch_perception.errors import InputError
from midastouch_perception.ros import qos
from midastouch_perception.ros.diagnostics import OK, Diagnostics
from midastouch_perception.ros.parameters import Parameter, Parameters
from midastouch_perception.ros.spin import run

from ..bags import BagWriter
from ..messages import SEQUENCE_TOPICS, Message, Topic
from .message_types import message_class

TOPICS = (
    *SEQUENCE_TOPICS,
    Topic("/tactile/contact", "midastouch_msgs/msg/TactileContact"),
    Topic("/tactile/code", "midastouch_msgs/msg/TactileCode"),
    Topic("/filter_status", "midastouch_msgs/msg/FilterStatus", latched=True),
    Topic("/pose", "geometry_msgs/msg/PoseWithCovarianceStamped", latched=True),
    Topic("/pose_modes", "midastouch_msgs/msg/PoseModes"),
    Topic("/particles", "geometry_msgs/msg/PoseArray"),
)
"""Inputs and results of the pipeline."""

PARAMETERS = (Parameter("path", "", "Bag to write: an .mcap file, or a folder for any other name"),)

_DEPTH = 1000


class Recorder(Node):
    """Records `topics` into the bag named by the parameter `path`, which appears when the node is destroyed.

    Messages are stamped with the node's clock: with `use_sim_time` that is the time of a replay. What comes
    before the clock starts is stamped with its start. `metadata` are texts kept in the bag. Raises InputError
    if the path is taken or a message type is not installed.
    """

    def __init__(self, topics: Sequence[Topic] = TOPICS, metadata: dict[str, str] | None = None, **kwargs) -> None:
        super().__init__("recorder", **kwargs)
        path = Parameters(self, PARAMETERS)["path"]
        if not path:
            raise InputError("recorder: parameter 'path' is empty; name the bag to write")
        kinds = [message_class(topic.type_name) for topic in topics]
        self.counts = dict.fromkeys((topic.name for topic in topics), 0)
        self._early: list[tuple[Topic, bytes]] = []
        self._open = contextlib.ExitStack()
        self._bag = self._open.enter_context(BagWriter(path, metadata))
        for topic, kind in zip(topics, kinds, strict=True):
            profile = qos.latched(_DEPTH) if topic.latched else qos.stream_subscriber(_DEPTH, reliable=True)
            self.create_subscription(
                kind, topic.name, lambda data, topic=topic: self._on_message(topic, data), profile, raw=True
            )
        Diagnostics(self, lambda: (OK, f"recording {path}", self.counts))

    def destroy_node(self) -> None:
        """Complete the bag, then destroy the node."""
        with self._open:
            self._write_early(0)
        super().destroy_node()

    def _on_message(self, topic: Topic, data: bytes) -> None:
        self.counts[topic.name] += 1
        now = self.get_clock().now().nanoseconds
        if now == 0:
            self._early.append((topic, data))
            return
        self._write_early(now)
        self._write(topic, data, now)

    def _write_early(self, now: int) -> None:
        early, self._early = self._early, []
        for topic, data in early:
            self._write(topic, data, now)

    def _write(self, topic: Topic, data: bytes, now: int) -> None:
        self._bag.write(Message(topic.name, topic.type_name, now, data, topic.latched))


def main(args: Sequence[str] | None = None) -> int:
    """Entry point of the executable."""
    return run(lambda: [Recorder()], args)


if __name__ == "__main__":
    sys.exit(main())
