"""Whether a topic comes from one publisher, as the stream of one sensor must."""

from __future__ import annotations

from rclpy.node import Node


class OnlyPublisher:
    """Watches who publishes a topic that a node subscribes."""

    def __init__(self, node: Node, topic: str):
        self._node, self._topic = node, topic
        self._told = ""

    @property
    def problem(self) -> str:
        """The publishers, if there are several, and the mend; empty if not. The log has it when it changes."""
        found = self._node.get_publishers_info_by_topic(self._topic)
        problem = ""
        if len(found) > 1:
            names = sorted(f"{info.node_namespace.rstrip('/')}/{info.node_name}" for info in found)
            topic = self._node.resolve_topic_name(self._topic)
            problem = f"{topic} has {len(names)} publishers: {', '.join(names)}; stop all but one of them"
        if problem and problem != self._told:
            self._node.get_logger().warning(problem)
        self._told = problem
        return problem
