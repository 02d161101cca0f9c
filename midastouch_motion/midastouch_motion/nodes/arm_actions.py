"""Acts as the actions `touch`, `slide`, `lift` and `approach`: goals from acts, acts from goals, ends from results."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from geometry_msgs.msg import Vector3

from midastouch_common.errors import InputError
from midastouch_common.message_arrays import pose_from_msg
from midastouch_common.ros.conversions import stamped_pose
from midastouch_common.ros.goals import direction_in, heading_in, length_in, pose_in
from midastouch_msgs import action

from ..exploration.acts import Act, Approach, Done, Lift, Slide, Touch

KINDS = {Touch: action.Touch, Slide: action.Slide, Lift: action.Lift, Approach: action.Approach}
"""The type of the action for each kind of act."""

_FARTHEST = 0.2  # m, of a touch or a lift
_LONGEST = 2.0  # m, of a slide


def goal_of(act: Act, base: str) -> Any:
    """Return the goal that asks for an act; base: name of the arm's base frame."""
    match act:
        case Touch(distance, direction):
            x, y, z = map(float, direction)
            return action.Touch.Goal(distance=distance, direction=Vector3(x=x, y=y, z=z))
        case Slide(heading, length):
            return action.Slide.Goal(heading=heading, length=length)
        case Lift(height):
            return action.Lift.Goal(height=height)
        case Approach(pose):
            return action.Approach.Goal(pose=stamped_pose(base, pose))


def act_of(goal: Any, base: str) -> Act:
    """Return the act that a goal asks for; InputError for a goal that makes no sense."""
    match goal:
        case action.Touch.Goal():
            distance, direction = length_in("distance", goal.distance, _FARTHEST), direction_in(goal.direction)
            return Touch(distance) if direction is None else Touch(distance, tuple(direction))
        case action.Slide.Goal():
            return Slide(heading_in(goal.heading), length_in("length", goal.length, _LONGEST))
        case action.Lift.Goal():
            return Lift(length_in("height", goal.height, _FARTHEST))
        case _:
            return Approach(pose_in(goal.pose, base))


def done_of(result: Any | None, base: str, touching: bool, seen: np.ndarray) -> Done:
    """Return how an act ended, from the action's result (None if the goal was not accepted).

    touching: True if the gel touched before; seen: its newest pose T_base_gel (4, 4) on TF, which is used if the result
    has no pose in the base frame; TF may lag behind the result.
    """
    if result is None:
        return Done(False, "the arm refuses its goal", 0.0, touching, seen)
    try:
        pose = pose_from_msg(result.pose.pose) if result.pose.header.frame_id == base else seen
    except InputError:
        pose = seen
    path = result.path if math.isfinite(result.path) else 0.0
    return Done(result.success, result.message, path, result.depth > 0, pose)
