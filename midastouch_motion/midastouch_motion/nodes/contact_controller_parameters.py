"""Parameters of `contact_controller`, and the controller that follows from them."""

from __future__ import annotations

import math

import numpy as np

from midastouch_common.errors import InputError
from midastouch_common.ros.managed_node import AUTOSTART
from midastouch_common.ros.parameters import Parameter, Parameters
from midastouch_perception.sensor_model import MAX_PENETRATION

from ..control.contact_servo import ContactServo, Limits
from ..control.controller import Controller
from ..control.guard import Guard
from ..control.wrench import GEL_STIFFNESS, HEAVIEST, ForceModel

SHALLOWEST = 1e-4
"""Smallest depth to hold [m]: the smaller a depth is, the slower the gel approaches."""

_SIMULATED_AHEAD = 1.0  # s that stamps may be ahead: a simulator's time comes as messages, which are late, too

PARAMETERS = (
    Parameter("base_frame_id", "base_link", "Frame at rest, in which the box is"),
    Parameter("sensor_frame_id", "digit_gel_frame", "Gel frame, whose twists are commanded"),
    Parameter("sensor_model", "digit_tacto", "Geometry of the sensor, as of tdn"),
    Parameter("depth", 5e-4, "Depth of the gel, unless a goal gives one", unit="m", minimum=SHALLOWEST, maximum=2e-3),
    Parameter("max_depth", 1e-3, "A gel that gets deeper is pulled back; 2 mm at most", unit="m", minimum=2e-4),
    Parameter("speed", 0.01, "Fastest motion in contact", unit="m/s", minimum=1e-4, maximum=0.1),
    Parameter(
        "air_speed",
        0.02,
        "Fastest motion in the air; approaches stay so slow that they can stop within `max_depth`",
        unit="m/s",
        minimum=1e-4,
        maximum=0.25,
    ),
    Parameter("turn_speed", 0.5, "Fastest turn", unit="rad/s", minimum=0.01, maximum=2.0),
    Parameter(
        "acceleration",
        0.2,
        "Fastest change of speed; turns change at once, and a stop is at once",
        unit="m/s^2",
        minimum=0.01,
        maximum=5.0,
    ),
    Parameter(
        "max_force",
        0.0,
        "More than this on the gel stops the arm, and so does a `wrench_topic` that does not come; 0: it need not",
        unit="N",
        minimum=0.0,
        maximum=1e3,
    ),
    Parameter(
        "wrench_topic",
        "wrench",
        "Force of the arm on its tool, in any frame on TF; empty: none. By it contacts are noticed that no image shows",
    ),
    Parameter(
        "tool_mass",
        0.0,
        "Of all that hangs on the arm's force sensor, as far as the arm does not subtract its weight; z of the base "
        "frame points up",
        unit="kg",
        minimum=0.0,
        maximum=HEAVIEST,
    ),
    Parameter(
        "gel_stiffness",
        GEL_STIFFNESS,
        "Pressure of the gel per depth: its modulus over its thickness, more for large contacts on thin gel. A force "
        "beyond this times the displaced volume is one of the rim",
        unit="Pa/m",
        minimum=1e6,
        maximum=1e11,
    ),
    Parameter(
        "force_margin",
        4.0,
        "Error of the arm's force; less is no contact. Of a UR e-Series 4, of a CB3 15",
        unit="N",
        minimum=0.1,
        maximum=100.0,
    ),
    Parameter(
        "stop_if_lost", True, "The arm stops while the filter is `lost`; explorations set it to false, to touch on"
    ),
    Parameter("box_low", [-1.0, -1.0, -1.0], "Corner of the box in the base frame that the gel keeps to", unit="m"),
    Parameter("box_high", [1.0, 1.0, 1.5], "Its opposite corner", unit="m"),
    Parameter(
        "max_tilt",
        3.1416,
        "Largest angle between the z axes of gel and base that the gel keeps to; 3.1416: any",
        unit="rad",
        minimum=0.0,
        maximum=3.1416,
    ),
    Parameter("rate", 100.0, "Twists per second", unit="Hz", minimum=20.0, maximum=1000.0, at_start=True),
    Parameter("arm_latency", 0.05, "From a twist to the motion of the arm", unit="s", minimum=1e-3, maximum=0.5),
    Parameter("hold", 0.1, "How long an `enable` holds", unit="s", minimum=0.02, maximum=10.0),
    Parameter(
        "stale_after",
        0.1,
        "Images, transforms and forces older than this stop the arm",
        unit="s",
        minimum=0.02,
        maximum=10.0,
    ),
    Parameter("queue_depth", 1, "Messages kept while the node is busy", minimum=1, maximum=10000, at_start=True),
    AUTOSTART,
)


def controller_of(p: Parameters, simulated: bool) -> Controller:
    """Return the controller with these limits, in `simulated` time or not; raises InputError if they exclude all."""
    if p["depth"] >= p["max_depth"]:
        raise InputError(f"parameter depth: {p['depth']:g} m is not less than max_depth, {p['max_depth']:g} m")
    if p["max_depth"] > MAX_PENETRATION:
        raise InputError(
            f"parameter max_depth: {p['max_depth']:g} m is deeper than images show, {MAX_PENETRATION:g} m: of a gel "
            "that is pressed on, the depth is read smaller again"
        )
    limits = Limits(p["speed"], p["air_speed"], p["turn_speed"], p["acceleration"], p["max_depth"])
    box = np.array(p["box_low"]), np.array(p["box_high"])
    stale = p["stale_after"]
    ahead = max(stale, _SIMULATED_AHEAD) if simulated else stale
    force = p["max_force"] or math.inf
    guard = Guard(*box, p["max_depth"], p["hold"], stale, ahead, force, p["max_tilt"])
    if p["max_force"] and not p["wrench_topic"]:
        raise InputError("parameter max_force: it needs a force, and wrench_topic is empty")
    forces = ForceModel(p["tool_mass"], p["gel_stiffness"], p["force_margin"])
    return Controller(ContactServo(limits, p["arm_latency"]), guard, forces)
