"""A goal of an action, and how it goes, for tests of nodes that offer or use actions."""

from __future__ import annotations

import re
from collections.abc import Callable

from rclpy.action import ActionClient
from rclpy.node import Node


class Asked:
    """A goal that was sent. spin_until(done, what) waits for events.

    Attributes: handle, once it is accepted; status and result, once there is one; feedback, the messages so far.
    """

    def __init__(self, companion: Node, spin_until: Callable[[Callable[[], object], str], None], kind: type, **goal):
        self._until, self.handle, self.feedback = spin_until, None, []
        self.status = self.result = None
        client = ActionClient(companion, kind, re.sub("(?<!^)(?=[A-Z])", "_", kind.__name__).lower())
        spin_until(client.server_is_ready, f"the action {kind.__name__}")
        sent = client.send_goal_async(kind.Goal(**goal), lambda message: self.feedback.append(message.feedback))
        sent.add_done_callback(self._on_accepted)

    def _on_accepted(self, future) -> None:
        self.handle = future.result()
        self.handle.get_result_async().add_done_callback(self._on_result)

    def _on_result(self, future) -> None:
        self.status, self.result = future.result().status, future.result().result

    def ended(self):
        """Its result, once it has one."""
        self._until(lambda: self.result is not None, "the end of the goal")
        return self.result

    def outcome(self):
        """Its status and result, once it has ended."""
        self.ended()
        return self.status, self.result
