"""Motions that goals ask for; InputError for a goal that makes no sense."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from midastouch_common.errors import InputError
from midastouch_common.ros.goals import direction_in, heading_in, length_in, pose_in
from midastouch_common.ros.parameters import Parameters
from midastouch_msgs.action import Approach, Lift, Slide, Touch

from ..control import skills
from .contact_controller_parameters import SHALLOWEST

_FARTHEST = 0.2  # m, of a touch or a lift
_LONGEST = 2.0  # m, of a slide


def _touch(goal: Touch.Goal, parameters: Parameters) -> skills.TouchSkill:
    distance = length_in("distance", goal.distance, _FARTHEST)
    return skills.TouchSkill(_depth(goal, parameters), distance, direction_in(goal.direction))


def _slide(goal: Slide.Goal, parameters: Parameters) -> skills.SlideSkill:
    length = length_in("length", goal.length, _LONGEST)
    return skills.SlideSkill(heading_in(goal.heading), length, _depth(goal, parameters))


def _lift(goal: Lift.Goal, parameters: Parameters) -> skills.LiftSkill:
    return skills.LiftSkill(length_in("height", goal.height, _FARTHEST))


def _approach(goal: Approach.Goal, parameters: Parameters) -> skills.ApproachSkill:
    pose = pose_in(goal.pose, parameters["base_frame_id"])
    low, high = np.array(parameters["box_low"]), np.array(parameters["box_high"])
    if not ((low <= pose[:3, 3]) & (pose[:3, 3] <= high)).all():
        raise InputError("pose: outside of the box")
    if pose[2, 2] < np.cos(parameters["max_tilt"]) - 1e-9:
        raise InputError("pose: outside of the cone")
    return skills.ApproachSkill(pose)


SKILL_OF: dict[type, Callable[[Any, Parameters], skills.Skill]] = {
    Touch: _touch,
    Slide: _slide,
    Lift: _lift,
    Approach: _approach,
}
"""Function that makes a motion of a goal and the node's parameters, by kind of action."""


def _depth(goal: Touch.Goal | Slide.Goal, parameters: Parameters) -> float:
    most = parameters["max_depth"]
    if goal.depth != 0 and not SHALLOWEST <= goal.depth < most:
        raise InputError(
            f"depth {goal.depth:g} is not between {SHALLOWEST:g} and max_depth, {most:g} m; 0 is the default"
        )
    return goal.depth or parameters["depth"]
