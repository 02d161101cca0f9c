"""Client of an arm's actions for an explorer: one act at a time."""

from __future__ import annotations

import time
import uuid
from collections.abc import Callable
from typing import Any

from action_msgs.msg import GoalStatus
from rclpy.action import ActionClient
from rclpy.action.client import ClientGoalHandle
from rclpy.node import Node
from rclpy.task import Future
from unique_identifier_msgs.msg import UUID

from midastouch_common.ros.goals import name_of

from ..exploration.acts import Act
from .arm_actions import KINDS, goal_of

ANSWER_S = 2.0
"""s until a goal counts as unanswered: an answer is lost if DDS does not know its reader yet."""


class ArmClient:
    """Client that asks for acts. on_end(result) is called after each, with None for a goal that was not accepted.

    Attribute: heard_at [s]: time at which the arm was last heard from, on the monotonic clock.
    Args: base: name of the arm's base frame.
    """

    def __init__(self, node: Node, base: str, on_end: Callable[[Any | None], None]):
        self._base, self._on_end = base, on_end
        self._clients = {act: ActionClient(node, kind, name_of(kind)) for act, kind in KINDS.items()}
        self._goal: ClientGoalHandle | None = None
        self._sent: Future | None = None  # of a goal that is unanswered
        self._sent_at = 0.0
        self.heard_at = time.monotonic()

    def close(self) -> None:
        """Stop the arm, even if it has not accepted its goal yet, and ask for no more acts."""
        if self._goal is not None:
            self._goal.cancel_goal_async()
            self._goal = self._sent = None
        for client in self._clients.values():
            client.destroy()

    @property
    def trouble(self) -> str:
        """Reason in words why no act can be asked for; empty if all actions are offered."""
        offered = all(client.server_is_ready() for client in self._clients.values())
        return "" if offered else "no node offers the actions touch, slide, lift and approach"

    def carry_out(self, act: Act) -> None:
        """Ask for an act."""
        self.heard_at = self._sent_at = time.monotonic()
        client, goal_id = self._clients[type(act)], UUID(uuid=list(uuid.uuid4().bytes))
        self._goal = ClientGoalHandle(client, goal_id, None)  # which can be cancelled before there is an answer
        self._sent = client.send_goal_async(goal_of(act, self._base), self._on_feedback, goal_id)
        self._sent.add_done_callback(self._on_answer)

    def look(self) -> None:
        """Ask for the result of a goal that stays unanswered; call this regularly."""
        if self._sent is not None and time.monotonic() - self._sent_at > ANSWER_S:
            self._sent = None
            self._goal.get_result_async().add_done_callback(self._on_result)

    def _on_feedback(self, _) -> None:
        self.heard_at = time.monotonic()

    def _on_answer(self, answer: Future) -> None:
        if answer is not self._sent:  # it comes too late
            return
        self._sent = None
        goal: ClientGoalHandle = answer.result()
        if goal.accepted:
            goal.get_result_async().add_done_callback(self._on_result)
        else:
            self._goal = None
            self._on_end(None)

    def _on_result(self, answer: Future) -> None:
        self.heard_at, self._goal = time.monotonic(), None
        known = answer.result().status != GoalStatus.STATUS_UNKNOWN
        self._on_end(answer.result().result if known else None)
