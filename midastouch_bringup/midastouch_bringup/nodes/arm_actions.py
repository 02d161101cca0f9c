"""Acts as the actions `touch`, `slide`, `lift` and `approach`: the goal of an act, and the act of a goal."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from std_msgs.msg import Header

from midastouch_common.errors import InputError
from midastouch_common.message_arrays import pose_from_msg
from midastouch_common.ros.conversions import pose_to_msg
from midastouch_msgs import action

from ..explore.acts import Act, Approach, Lift, Slide, Touch

KINDS = {Touch: action.Touch, Slide: action.Slide, Lift: action.Lift, Approach: action.Approach}
"""The type of the action for each kind of act."""

_FARTHEST = 2.0  # m


def name_of(kind: type) -> str:
    """The name of an action of this type."""
    return kind.__name__.lower()


def goal_of(act: Act, base: str) -> Any:
    """The goal that asks for an act; base: name of the arm's base frame."""
    match act:
        case Touch(distance):
            return action.Touch.Goal(distance=distance)
        case Slide(heading, length):
            return action.Slide.Goal(heading=heading, length=length)
        case Lift(height):
            return action.Lift.Goal(height=height)
        case Approach(pose):
            return action.Approach.Goal(pose=PoseStamped(header=Header(frame_id=base), pose=pose_to_msg(pose)))


def act_of(goal: Any, base: str) -> Act:
    """The act that a goal asks for; InputError for what makes no sense."""
    match goal:
        case action.Touch.Goal():
            direction = np.array([goal.direction.x, goal.direction.y, goal.direction.z])
            if not np.isfinite(direction).all():
                raise InputError("direction: not finite")
            distance = _checked("distance", goal.distance)
            return Touch(distance, tuple(direction)) if direction.any() else Touch(distance)
        case action.Slide.Goal():
            if not math.isfinite(goal.heading):
                raise InputError("heading: not finite")
            return Slide(goal.heading, _checked("length", goal.length))
        case action.Lift.Goal():
            return Lift(_checked("height", goal.height))
        case _:
            if goal.pose.header.frame_id != base:
                raise InputError(f"pose: it is in '{goal.pose.header.frame_id}'; give it in '{base}'")
            return Approach(pose_from_msg(goal.pose.pose))


def _checked(name: str, value: float) -> float:
    if not 0 < value <= _FARTHEST:
        raise InputError(f"{name} {value:g} is not between 0 and {_FARTHEST:g} m")
    return value
