"""Goals of actions that a node carries out itself, one message at a time, instead of in a callback that waits."""

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
    """Offers an action, by its type and name. on_goal(goal) is called with each goal, on_cancel(goal) once it is being
    cancelled; the node ends every one by `end_goal`.

    Close it before the node is destroyed: a goal could not be ended any more.
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
            execute_callback=lambda goal: None,  # `end_goal` names another one
            handle_accepted_callback=on_goal,
            cancel_callback=self._accept_cancel,
        )

    def close(self) -> None:
        """Offer it no more."""
        self._server.destroy()

    def _accept_cancel(self, goal: ServerGoalHandle) -> CancelResponse:
        # it is being cancelled only once this has returned
        self._node.executor.create_task(lambda: self._on_cancel(goal))
        return CancelResponse.ACCEPT


def end_goal(goal: ServerGoalHandle, success: bool, result: Any) -> None:
    """End a goal with a result: as cancelled if that was asked for, else as succeeded or aborted."""

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
    """The name of an action of this type, if it is offered under that of its type."""
    return kind.__name__.lower()


def length_in(name: str, value: float, most: float) -> float:
    """A length [m] of a goal; InputError unless it is more than nothing and at most `most`."""
    if not 0 < value <= most:
        raise InputError(f"{name} {value:g} is not between 0 and {most:g} m")
    return value


def heading_in(value: float) -> float:
    """A heading [rad] of a goal; InputError unless it is finite."""
    if not math.isfinite(value):
        raise InputError("heading: not finite")
    return value


def direction_in(message: Vector3) -> np.ndarray | None:
    """A direction (3,) of a goal, its longest part 1, None if none is given; InputError unless it is finite."""
    direction = point_from_msg(message)
    if not np.isfinite(direction).all():
        raise InputError("direction: not finite")
    # the square of what is given may be no number that there is
    return direction / np.abs(direction).max() if direction.any() else None


def pose_in(message: PoseStamped, frame: str) -> np.ndarray:
    """A pose (4, 4) of a goal; InputError unless it is in this frame, and finite."""
    if message.header.frame_id != frame:
        raise InputError(f"pose: it is in '{message.header.frame_id}'; give it in '{frame}'")
    return pose_from_msg(message.pose)
