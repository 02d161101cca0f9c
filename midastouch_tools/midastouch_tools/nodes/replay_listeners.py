"""Publishers of a replay, and its listeners: the filter, whose answers it awaits, and all that must be there first."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.duration import Duration
from rclpy.node import Node
from rosgraph_msgs.msg import Clock

from midastouch_common.message_arrays import stamp_ns
from midastouch_common.ros import qos
from midastouch_common.ros.conversions import stamp_from_ns
from midastouch_common.ros.graph_watch import LifecycleWatch
from midastouch_msgs.msg import FilterStatus

from ..bags.messages import TF_TOPIC, Message, Topic
from ..replay.flow_control import FlowControl
from ..replay.source import is_image
from ..text_table import counted
from .message_types import live_name, message_class

_UNKNOWN = "_NODE_NAME_UNKNOWN_"  # the middleware's name for a node of which only the topics were heard of
_LOOK_S = 0.02
_LONG_S = 4.0  # for nodes that run to be discovered
_CONNECTS_S = 2.0  # for subscribers that are known; those whose QoS does not match never connect


class FilterAnswers:
    """Subscription to the filter's answers on `topic` and to its diagnostics, for the flow control.

    Attributes: topic; state: of the newest answer, empty before the first."""

    def __init__(self, node: Node, topic: str, flow: FlowControl):
        self._node, self._flow, self.topic, self.state = node, flow, topic, ""
        self._statuses = node.create_subscription(FilterStatus, topic, self._on_status, qos.latched(depth=50))
        node.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 10)

    def publishers(self) -> set[str]:
        """Full names of the nodes that answer."""
        return _names(self._node.get_publishers_info_by_topic(self._statuses.topic_name))

    @property
    def connected(self) -> bool:
        """True while a publisher of answers is connected."""
        return self._statuses.get_publisher_count() > 0

    def _on_status(self, status: FilterStatus) -> None:
        waiting = status.state == FilterStatus.STATE_WAITING
        self.state = self.state if waiting else status.state
        self._flow.on_status(stamp_ns(status.header.stamp), waiting)

    def _on_diagnostics(self, msg: DiagnosticArray) -> None:
        for status in msg.status:
            # a filter that reports no state is loading, or not at work
            at_work = any(item.key == "state" for item in status.values)
            if at_work and status.name.rpartition(": ")[2] in self.publishers():
                self._flow.on_report()


class Listeners:
    """Watch for all nodes that must hear a recording: messages sent earlier would be lost to them.

    answers: of the filter, None if none is awaited; nodes: lifecycle nodes that must be active; subscribers: their
    number for the images.
    """

    def __init__(
        self, node: Node, output: ReplayOutput, answers: FilterAnswers | None, nodes: list[str], subscribers: int
    ):
        self._node, self._output, self._answers, self._subscribers = node, output, answers, subscribers
        self._nodes, self._images = LifecycleWatch(node, nodes), list(filter(is_image, output.topics))

    def wait(self, stopped: Callable[[], bool]) -> None:
        """Wait until all subscribers are there, or `stopped()`; the log names those that are missing for long."""
        logged, text, since = "", "", 0.0
        while not stopped() and (missing := self._missing()):
            former, text = text, f"waiting for {', '.join(missing)}"
            since = since if text == former else time.monotonic()
            if text != logged and time.monotonic() - since >= _LONG_S:
                logged = text
                self._node.get_logger().info(text)
            time.sleep(_LOOK_S)  # Python's: rclpy's raises if the process is told to stop meanwhile
        there = time.monotonic()
        while not (stopped() or self._output.connected) and time.monotonic() - there < _CONNECTS_S:
            time.sleep(_LOOK_S)

    @property
    def unheard(self) -> str:
        """Topics of images that nothing subscribes to; "" if they are heard."""
        return "" if any(map(self._output.listeners, self._images)) else " and ".join(self._images)

    def _missing(self) -> list[str]:
        """List in words what is missing: active nodes, subscribers of the images, the filter's subscription of TF."""
        missing = [self._nodes.waiting_for] if self._nodes.waiting_for else []
        wanted = self._subscribers - sum(map(self._output.listeners, self._images))
        if wanted > 0:
            missing.append(f"{counted(wanted, 'more subscriber')} of {' and '.join(self._images)}")
        if self._answers is None:
            return missing
        filters = self._answers.publishers()
        if not filters or not self._answers.connected:
            missing.append(f"a publisher of {self._answers.topic}")
        elif TF_TOPIC in self._output.topics:
            listeners = self._node.get_subscriptions_info_by_topic(TF_TOPIC)
            if not filters & _names(listeners) or self._output.listeners(TF_TOPIC) < len(listeners):
                missing.append(f"{' or '.join(sorted(filters))} to subscribe {TF_TOPIC}")
        return missing


def _names(infos: Iterable) -> set[str]:
    """Full names of the nodes that endpoints (rclpy's `TopicEndpointInfo`) belong to, as far as they are known yet."""
    return {f"{info.node_namespace.rstrip('/')}/{info.node_name}" for info in infos if info.node_name != _UNKNOWN}


_DEPTH = 100  # frames that a reliable subscriber (a recorder) may lag behind before it loses some


class ReplayOutput:
    """Publishers of a node for topics of a recording, by their names there; `clock`: also publish /clock.

    Raises InputError for a type of message that is not installed.
    """

    def __init__(self, node: Node, topics: Iterable[Topic], clock: bool):
        self._publishers = {
            topic.name: node.create_publisher(message_class(topic.type_name), live_name(topic.name), _profile(topic))
            for topic in topics
        }
        self._clock = node.create_publisher(Clock, "/clock", 10) if clock else None
        self._node = node

    @property
    def topics(self) -> list[str]:
        """Names of the topics in the recording."""
        return list(self._publishers)

    def listeners(self, topic: str) -> int:
        """Number of subscribers of a topic."""
        return self._publishers[topic].get_subscription_count()

    @property
    def connected(self) -> bool:
        """True once every subscriber that is known, such as a recorder, gets what is sent."""
        every = self._publishers.values()
        return all(each.get_subscription_count() >= self._node.count_subscribers(each.topic_name) for each in every)

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
