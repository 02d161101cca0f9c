"""Goals of an action that are not executed until they end."""

from __future__ import annotations

from typing import Any

from rclpy.action.server import ServerGoalHandle


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
