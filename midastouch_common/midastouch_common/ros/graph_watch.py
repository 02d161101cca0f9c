"""Watches on other nodes: the states of lifecycle nodes, and the publishers of a topic."""

from __future__ import annotations

import time
from collections.abc import Iterable

from lifecycle_msgs.msg import TransitionEvent
from lifecycle_msgs.srv import GetState
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.task import Future

from . import qos

_ABSENT = "not found"  # it may run: to be discovered takes seconds
_LOOK_S = 0.1  # for nodes that have come or gone
_ASK_AGAIN_S = 1.0  # an event can be lost during discovery, and an answer with a node that dies


class LifecycleWatch:
    """Watch on the states of lifecycle nodes, by one call of `get_state` and then their `transition_event`.

    node: the node that listens; it must be spun.
    names: of the nodes to watch, absolute or in the namespace of `node`.
    """

    def __init__(self, node: Node, names: Iterable[str]):
        self._watched = [_Watched(node, name) for name in names]
        node.create_timer(_LOOK_S, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))

    @property
    def states(self) -> dict[str, str]:
        """Label of each node's state by the node's name, e.g. `inactive`; `not found` if the node is missing."""
        return {watched.name: watched.state for watched in self._watched}

    @property
    def waiting_for(self) -> str:
        """Names and states of the nodes that are not active, as text; empty when all are active."""
        return ", ".join(f"{name} ({state})" for name, state in self.states.items() if state != "active")

    def _look(self) -> None:
        for watched in self._watched:
            watched.look()


class _Watched:
    """One node, and the state that it has reported."""

    def __init__(self, node: Node, name: str):
        self.name, self.state = name, _ABSENT
        self._client = node.create_client(GetState, f"{name}/get_state")
        self._answer: Future | None = None
        self._asked_at = 0.0
        node.create_subscription(TransitionEvent, f"{name}/transition_event", self._on_event, qos.COMMAND)

    def look(self) -> None:
        """Ask the node for its state unless it is known to be active; forget the state of a node that is gone."""
        if not self._client.service_is_ready():
            self._drop_question()
            self.state = _ABSENT
        elif self.state != "active" and (self._answer is None or time.monotonic() - self._asked_at > _ASK_AGAIN_S):
            self._drop_question()
            self._asked_at = time.monotonic()
            self._answer = self._client.call_async(GetState.Request())
            self._answer.add_done_callback(self._on_answer)

    def _on_answer(self, answer: Future) -> None:
        if answer is self._answer:  # otherwise it comes too late
            self.state = answer.result().current_state.label

    def _on_event(self, event: TransitionEvent) -> None:
        # an answer that is still due may be older than this event
        self._drop_question()
        self.state = event.goal_state.label

    def _drop_question(self) -> None:
        if self._answer is not None:
            self._client.remove_pending_request(self._answer)
            self._answer = None


def publishers(node: Node, topic: str) -> list[str]:
    """Return the full names of the nodes that publish a topic, sorted."""
    found = node.get_publishers_info_by_topic(topic)
    return sorted(f"{info.node_namespace.rstrip('/')}/{info.node_name}" for info in found)


def why_silent(node: Node, topic: str) -> str:
    """Return why nothing comes on a topic, as far as the graph shows it."""
    names = publishers(node, topic)
    return f"{', '.join(names)} publishes it, but sends none" if names else "no node publishes it"


class OnlyPublisher:
    """Check that a subscribed topic has a single publisher, as the stream of one sensor must."""

    def __init__(self, node: Node, topic: str):
        self._node, self._topic = node, topic
        self._logged = ""

    @property
    def problem(self) -> str:
        """Message that names the publishers and the fix if there are several, logged when it changes; or empty."""
        problem, names = "", publishers(self._node, self._topic)
        if len(names) > 1:
            topic = self._node.resolve_topic_name(self._topic)
            fix = "stop all but one of them, or set another ROS_DOMAIN_ID if they are not yours"
            problem = f"{topic} has {len(names)} publishers: {', '.join(names)}; {fix}"
        if problem and problem != self._logged:
            self._node.get_logger().warning(problem)
        self._logged = problem
        return problem
