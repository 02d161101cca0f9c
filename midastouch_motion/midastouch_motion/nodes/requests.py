"""What a goal asks for, as a motion; InputError for what makes no sense."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from midastouch_common.errors import InputError
from midastouch_common.message_arrays import pose_from_msg
from midastouch_common.ros.parameters import Parameters
from midastouch_msgs.action import Approach, Lift, Slide, Touch

from .. import skills

_FARTHEST = 0.2  # m, of a touch or a lift
_LONGEST = 2.0  # m, of a slide


def _touch(goal: Touch.Goal, parameters: Parameters) -> skills.Touch:
    direction = np.array([goal.direction.x, goal.direction.y, goal.direction.z])
    if not np.isfinite(direction).all():
        raise InputError("direction: not finite")
    depth, distance = _depth(goal, parameters), _checked("distance", goal.distance, _FARTHEST)
    return skills.Touch(depth, distance, direction if np.linalg.norm(direction) > 0 else None)


def _slide(goal: Slide.Goal, parameters: Parameters) -> skills.Slide:
    if not math.isfinite(goal.heading):
        raise InputError("heading: not finite")
    return skills.Slide(goal.heading, _checked("length", goal.length, _LONGEST), _depth(goal, parameters))


def _lift(goal: Lift.Goal, parameters: Parameters) -> skills.Lift:
    return skills.Lift(_checked("height", goal.height, _FARTHEST))


def _approach(goal: Approach.Goal, parameters: Parameters) -> skills.Approach:
    base, frame = parameters["base_frame_id"], goal.pose.header.frame_id
    if frame != base:
        raise InputError(f"pose: it is in '{frame}'; give it in '{base}'")
    pose = pose_from_msg(goal.pose.pose)
    low, high = np.array(parameters["box_low"]), np.array(parameters["box_high"])
    if not ((low <= pose[:3, 3]) & (pose[:3, 3] <= high)).all():
        raise InputError("pose: outside of the box")
    return skills.Approach(pose)


SKILL_OF: dict[type, Callable[[Any, Parameters], skills.Skill]] = {
    Touch: _touch,
    Slide: _slide,
    Lift: _lift,
    Approach: _approach,
}
"""By the kind of action, what makes a motion of its goal and the parameters of the node."""


def _depth(goal: Touch.Goal | Slide.Goal, parameters: Parameters) -> float:
    most = parameters["max_depth"]
    if not 0 <= goal.depth < most:
        raise InputError(f"depth {goal.depth:g} is not between 0 and max_depth, {most:g} m; 0 is the default")
    return goal.depth or parameters["depth"]


def _checked(name: str, value: float, most: float) -> float:
    if not 0 < value <= most:
        raise InputError(f"{name} {value:g} is not between 0 and {most:g} m")
    return value
