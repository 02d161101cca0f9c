"""Action goals that a node carries out step by step, as messages arrive, instead of in a callback that waits."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped, Vector3
from rclpy.action import ActionServer, CancelResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.node import Node

from ..errors import InputError
from ..message_arrays import point_from_msg, pose_from_msg


class GoalServer:
    """Server of an action, given by its type and name.

    It calls on_goal(goal) with each goal, and on_cancel(goal) once the goal is being cancelled. The node ends each goal
    by `end_goal`. Close the server before the node is destroyed: afterwards a goal could not be ended.
    """

    def __init__(
        self,
        node: Node,
        kind: type,
        name: str,
        on_goal: Callable[[ServerGoalHandle], None],
        on_cancel: Callable[[ServerGoalHandle], None],
    ):
        self._node, self._on_cancel = node, on_cancel
        self._server = ActionServer(
            node,
            kind,
            name,
            execute_callback=lambda goal: None,  # `end_goal` supplies another one
            handle_accepted_callback=on_goal,
            cancel_callback=self._accept_cancel,
        )

    def close(self) -> None:
        """Stop offering the action."""
        self._server.destroy()

    def _accept_cancel(self, goal: ServerGoalHandle) -> CancelResponse:
        # the goal counts as being cancelled only after this has returned
        self._node.executor.create_task(lambda: self._on_cancel(goal))
        return CancelResponse.ACCEPT


def end_goal(goal: ServerGoalHandle, success: bool, result: Any) -> None:
    """End a goal with a result: as cancelled if a client asked for that, otherwise as succeeded or aborted."""

    def finish(goal: ServerGoalHandle) -> Any:
        if goal.is_cancel_requested:
            goal.canceled()
        elif success:
            goal.succeed()
        else:
            goal.abort()
        return result

    goal.execute(finish)


def name_of(kind: type) -> str:
    """Return the default name of an action of this type: the name of the type in lower case."""
    return kind.__name__.lower()


def length_in(name: str, value: float, most: float) -> float:
    """Return a length [m] of a goal; InputError unless it is more than 0 and at most `most`."""
    if not 0 < value <= most:
        raise InputError(f"{name} {value:g} is not between 0 and {most:g} m")
    return value


def heading_in(value: float) -> float:
    """Return a heading [rad] of a goal; InputError unless it is finite."""
    if not math.isfinite(value):
        raise InputError("heading: not finite")
    return value


def direction_in(message: Vector3) -> np.ndarray | None:
    """Return a direction (3,) of a goal, its largest component 1 or -1, None for zeros; InputError unless finite."""
    direction = point_from_msg(message)
    if not np.isfinite(direction).all():
        raise InputError("direction: not finite")
    # no Euclidean norm: the square of a large component can overflow
    return direction / np.abs(direction).max() if direction.any() else None


def pose_in(message: PoseStamped, frame: str) -> np.ndarray:
    """Return a pose (4, 4) of a goal; InputError unless it is in this frame, and finite."""
    if message.header.frame_id != frame:
        raise InputError(f"pose: it is in '{message.header.frame_id}'; give it in '{frame}'")
    return pose_from_msg(message.pose)
