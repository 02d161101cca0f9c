"""What a replay publishes: the topics of the recording, and its time."""

from __future__ import annotations

from collections.abc import Iterable

from rclpy.duration import Duration
from rclpy.node import Node
from rosgraph_msgs.msg import Clock

from midastouch_common.ros import qos
from midastouch_common.ros.conversions import stamp_from_ns

from ..bags.messages import TF_TOPIC, Message, Topic
from .message_types import live_name, message_class

_DEPTH = 100  # frames that a reliable subscriber (a recorder) may lag behind before it loses some


class ReplayOutput:
    """Publishers of a node for topics of a recording, by their names there; `clock`: of /clock, too.

    Raises InputError for a type of message that is not installed.
    """

    def __init__(self, node: Node, topics: Iterable[Topic], clock: bool):
        self._publishers = {
            topic.name: node.create_publisher(message_class(topic.type_name), live_name(topic.name), _profile(topic))
            for topic in topics
        }
        self._clock = node.create_publisher(Clock, "/clock", 10) if clock else None

    @property
    def topics(self) -> list[str]:
        """Names of the topics in the recording."""
        return list(self._publishers)

    def listeners(self, topic: str) -> int:
        """How many subscribers a topic has."""
        return self._publishers[topic].get_subscription_count()

    def send(self, message: Message) -> None:
        """Publish a message on the topic of its name."""
        self._publishers[message.topic].publish(message.data)

    def tell(self, recorded_ns: int) -> None:
        """Publish the recorded time, if that is wanted."""
        if self._clock is not None:
            self._clock.publish(Clock(clock=stamp_from_ns(recorded_ns)))

    def flush(self) -> None:
        """Wait, but not for long, until reliable subscribers have everything."""
        for publisher in self._publishers.values():
            publisher.wait_for_all_acked(Duration(seconds=2))


def _profile(topic: Topic):
    if topic.latched:
        return qos.latched(_DEPTH)
    return qos.TF if topic.name == TF_TOPIC else qos.stream_publisher(_DEPTH)
