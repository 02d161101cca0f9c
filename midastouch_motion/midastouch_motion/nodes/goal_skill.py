"""Skills that carry out the goals of the arm's actions; InputError for a goal that makes no sense."""

from __future__ import annotations

from typing import Any

import numpy as np

from midastouch_common.errors import InputError
from midastouch_common.ros.parameters import Parameters

from ..control import skills
from ..exploration.acts import Lift, Slide, Touch
from .arm_actions import act_of
from .contact_controller_parameters import SHALLOWEST


def skill_of(goal: Any, parameters: Parameters) -> skills.Skill:
    """Return the skill for a goal of `touch`, `slide`, `lift` or `approach`, by the node's parameters."""
    match act_of(goal, parameters["base_frame_id"]):
        case Touch(distance, direction):
            return skills.TouchSkill(_depth(goal.depth, parameters), distance, np.array(direction))
        case Slide(heading, length):
            return skills.SlideSkill(heading, length, _depth(goal.depth, parameters))
        case Lift(height):
            return skills.LiftSkill(height)
        case approach:
            return skills.ApproachSkill(_allowed(approach.pose, parameters))


def _depth(depth: float, parameters: Parameters) -> float:
    """Return the depth [m] of a goal, by default that of the parameters."""
    most = parameters["max_depth"]
    if depth != 0 and not SHALLOWEST <= depth < most:
        raise InputError(f"depth {depth:g} is not between {SHALLOWEST:g} and max_depth, {most:g} m; 0 is the default")
    return depth or parameters["depth"]


def _allowed(pose: np.ndarray, parameters: Parameters) -> np.ndarray:
    """Return a pose (4, 4) in the base frame, if it is within the box and the cone."""
    low, high = np.array(parameters["box_low"]), np.array(parameters["box_high"])
    if not ((low <= pose[:3, 3]) & (pose[:3, 3] <= high)).all():
        raise InputError("pose: outside of the box")
    if pose[2, 2] < np.cos(parameters["max_tilt"]) - 1e-9:
        raise InputError("pose: outside of the cone")
    return pose
