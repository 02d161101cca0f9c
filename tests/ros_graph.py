"""Graph for node tests: nodes under test and the test's own publishers and listeners in one executor.

The test itself spins, so nothing happens between two of its lines. It waits for events, never for a time.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import SetParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.task import Future

from midastouch_common.ros import qos

# Limits only a test that fails; on a busy machine milliseconds become seconds.
_TIMEOUT = 60.0
_ASK_AGAIN_S = 5.0
_BETWEEN_LOOKS = 0.005  # s; the executor does not wake when nodes discover each other


class Health:
    """What nodes have said on /diagnostics since this was made; of `node` alone if it is named."""

    def __init__(self, graph: RosGraph, node: str = "") -> None:
        self._graph, self._node = graph, node
        self._received: list[DiagnosticArray] = graph.listen(DiagnosticArray, "/diagnostics")

    @property
    def statuses(self) -> list[DiagnosticStatus]:
        """In the order of their arrival."""
        return [one for array in self._received for one in array.status if one.name.startswith(self._node)]

    @property
    def newest(self) -> DiagnosticStatus | None:
        """The last status, if one has come."""
        return self.statuses[-1] if self.statuses else None

    @property
    def values(self) -> dict[str, str]:
        """The newest value of each key."""
        return {pair.key: pair.value for one in self.statuses for pair in one.values}

    @property
    def warnings(self) -> list[str]:
        """The messages of all statuses that warn."""
        return [one.message for one in self.statuses if one.level != DiagnosticStatus.OK]

    def says(self, words: str) -> bool:
        """Whether a message has these words in it."""
        return any(words in one.message for one in self.statuses)

    def until(self, words: str) -> DiagnosticStatus:
        """Spin until a message has these words in it; return the last such status."""
        self._graph.spin_until(lambda: self.says(words), f"'{words}' in the diagnostics")
        return next(one for one in reversed(self.statuses) if words in one.message)

    def clear(self) -> None:
        """Forget what was said so far."""
        self._received.clear()


def _overrides(parameters: dict[str, Any]) -> list[Parameter]:
    return [Parameter(name, value=value) for name, value in parameters.items()]


class RosGraph:
    """The ROS graph of one test. `companion` is the test's own node."""

    def __init__(self) -> None:
        self._executor = SingleThreadedExecutor()
        self._nodes: list[Node] = []
        self.companion = self.add(Node, node_name="companion")

    def add(self, make_node: Callable[..., Node], parameters: dict[str, Any] | None = None, **options) -> Node:
        """Add the node that `make_node` returns, with parameter values as from a YAML file."""
        if parameters is not None:
            options["parameter_overrides"] = _overrides(parameters)
        node = make_node(**options)
        self._nodes.append(node)
        self._executor.add_node(node)
        return node

    def add_all(self, make_nodes: Callable[[dict], list[Node]], parameters: dict[str, dict[str, Any]]) -> list[Node]:
        """Add nodes that are made together; `make_nodes` gets rclpy's node options by node name."""
        nodes = make_nodes({name: {"parameter_overrides": _overrides(p)} for name, p in parameters.items()})
        for node in nodes:
            self._nodes.append(node)
            self._executor.add_node(node)
        return nodes

    def remove(self, node: Node) -> None:
        """Destroy one node."""
        self._nodes.remove(node)
        self._executor.remove_node(node)
        node.destroy_node()

    def remove_all(self) -> None:
        """Destroy all nodes and begin again with a new companion."""
        for node in [*self._nodes]:
            self.remove(node)
        self.companion = self.add(Node, node_name="companion")

    def publisher(self, kind: type, topic: str, profile: QoSProfile | None = None, latched: bool = False) -> Publisher:
        """Return a publisher that is already connected to a subscriber."""
        profile = qos.latched(10) if latched else profile or qos.stage_publisher(100)
        publisher = self.companion.create_publisher(kind, topic, profile)
        self.spin_until(lambda: publisher.get_subscription_count() > 0, f"a subscriber of {topic}")
        return publisher

    def listen(
        self, kind: type, topic: str, latched: bool = False, wanted: Callable[[Any], bool] = lambda message: True
    ) -> list:
        """Return the list to which the `wanted` messages of a topic are added; the publishers are already connected."""
        received: list = []
        profile = qos.latched(100) if latched else qos.stream_subscriber(100, reliable=True)

        def keep(message: Any) -> None:
            if wanted(message):
                received.append(message)

        subscription = self.companion.create_subscription(kind, topic, keep, profile)
        self.spin_until(lambda: self.companion.count_publishers(topic) > 0, f"a publisher of {topic}")
        publishers = self.companion.get_publishers_info_by_topic(subscription.topic_name)
        owners = {node.get_name(): node for node in self._nodes}
        for info in publishers:
            if (owner := owners.get(info.node_name)) is not None:
                matching = [p for p in owner.publishers if p.topic_name == subscription.topic_name]

                def heard(matching: list = matching) -> bool:
                    return all(p.get_subscription_count() > 0 for p in matching)

                self.spin_until(heard, f"the publisher of {topic} to see its listener")
        return received

    def health(self, node: str = "") -> Health:
        """Listen to /diagnostics, of one node if it is named."""
        return Health(self, node)

    def request(self, kind: type, name: str, request: Any) -> Future:
        """Call a service once it is available; return the future of its response."""
        client = self.companion.create_client(kind, name)
        self.spin_until(client.service_is_ready, f"service {name}")
        return client.call_async(request)

    def call(self, kind: type, name: str, request: Any) -> Any:
        """Call a service and return its response."""
        future = self.request(kind, name, request)
        self.spin_until(future.done, f"the response of {name}")
        return future.result()

    def set_parameters(self, node: str, **values: Any) -> list[SetParametersResult]:
        """Set parameters of a node, each by itself, as `ros2 param set` does; return one result for each."""
        request = SetParameters.Request(parameters=[each.to_parameter_msg() for each in _overrides(values)])
        return self.call(SetParameters, f"{node}/set_parameters", request).results

    def set_parameter(self, node: str, name: str, value: Any) -> SetParametersResult:
        """Set one parameter of a node."""
        return self.set_parameters(node, **{name: value})[0]

    def change_state(self, node: str, transition: str) -> bool:
        """Request a transition of a lifecycle node as nav2's lifecycle manager does; return whether it succeeded."""
        number = getattr(Transition, f"TRANSITION_{transition.upper()}")
        request = ChangeState.Request(transition=Transition(id=number))
        return self.call(ChangeState, f"{node}/change_state", request).success

    def state_of(self, node: str) -> str:
        """Return the state that a lifecycle node reports. Asks again if no answer comes: Cyclone DDS drops one
        if the server has not discovered the client's reader within 100 ms."""
        questions: dict[float, Future] = {}

        def answered() -> bool:
            if time.monotonic() - max(questions, default=0.0) > _ASK_AGAIN_S:
                questions[time.monotonic()] = self.request(GetState, f"{node}/get_state", GetState.Request())
            return any(future.done() for future in questions.values())

        self.spin_until(answered, f"the state of {node}")
        return next(future.result() for future in questions.values() if future.done()).current_state.label

    def spin_until(self, done: Callable[[], bool], what: str = "the awaited event") -> None:
        """Spin until `done()` is true; AssertionError naming `what` if that takes too long."""
        deadline = time.monotonic() + _TIMEOUT
        while not done():
            assert time.monotonic() < deadline, f"{what} did not come within {_TIMEOUT:.0f} s"
            self._executor.spin_once(timeout_sec=_BETWEEN_LOOKS)

    def spin_for(self, seconds: float) -> None:
        """Spin for a while, to show that something does not happen."""
        deadline = time.monotonic() + seconds
        while (left := deadline - time.monotonic()) > 0:
            self._executor.spin_once(timeout_sec=left)

    def close(self) -> None:
        """Destroy all nodes."""
        self._executor.shutdown()
        for node in self._nodes:
            node.destroy_node()


@contextlib.contextmanager
def open_graph() -> Iterator[RosGraph]:
    """Yield a graph for one test, in the DDS domain of the environment."""
    rclpy.init(args=[])
    graph = RosGraph()
    try:
        yield graph
    finally:
        graph.close()
        rclpy.try_shutdown()
