"""What a node listens with while it is active."""

from __future__ import annotations

from collections.abc import Callable

from rclpy.lifecycle import LifecycleNode

from .node import refuse_unused_overrides


class Connections:
    """The subscriptions and timers that a node makes in `begin()`; they are destroyed after `end()`, which ends what
    else `begin` has begun. So a matched subscription means an active node."""

    def __init__(self, node: LifecycleNode, begin: Callable[[], None], end: Callable[[], None]):
        self._node, self._begin, self._end = node, begin, end
        self._lasting: set | None = None  # what the node has at other times, too; None: it is not connected

    def open(self) -> None:
        """Begin; what is raised on the way leaves nothing behind."""
        self._lasting = {*self._node.subscriptions, *self._node.timers}
        try:
            self._begin()
            refuse_unused_overrides(self._node)
        except Exception:
            self.close()
            raise

    def close(self) -> None:
        """End, as far as it has begun; a no-op when it has not."""
        if self._lasting is None:
            return
        self._end()
        for subscription in {*self._node.subscriptions} - self._lasting:
            self._node.destroy_subscription(subscription)
        for timer in {*self._node.timers} - self._lasting:
            self._node.destroy_timer(timer)
        self._lasting = None
