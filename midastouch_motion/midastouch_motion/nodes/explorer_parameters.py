"""Parameters of the node `explorer`."""

from __future__ import annotations

from midastouch_common.frames import BASE_FRAME, GEL_FRAME, TRUTH_FRAME
from midastouch_common.ros.parameters import Parameter

PARAMETERS = (
    Parameter("seed", 0, "Of its motions at random", minimum=0, maximum=2**31 - 1),
    Parameter("max_motion", 0.0, "Longest motion to ask for; 0: the object's diagonal", "m", minimum=0.0, maximum=2.0),
    Parameter("max_path", 1.5, "It gives up after this path on the surface", "m", minimum=0.01, maximum=100.0),
    Parameter(
        "touch_distance",
        0.05,
        "How far below the gel it looks for a surface of which nothing is known, as at first",
        "m",
        minimum=1e-3,
        maximum=0.1,
    ),
    Parameter(
        "object_size",
        0.1,
        "About the object's diagonal, for motions at random while the filter does not know the object",
        "m",
        minimum=5e-3,
        maximum=2.0,
    ),
    Parameter("reach_low", [-10.0, -10.0, -10.0], "Corner of the box in the base frame in which it touches", "m"),
    Parameter("reach_high", [10.0, 10.0, 10.0], "Its opposite corner", "m"),
    Parameter(
        "max_tilt",
        3.1416,
        "Largest angle between the z axes of gel and base frame that the arm reaches, at most that of "
        "contact_controller; 3.1416: any",
        "rad",
        minimum=0.0,
        maximum=3.1416,
    ),
    Parameter(
        "reach_service",
        "",
        "Service (CheckReach) that checks, before slides and leaps, which poses the arm reaches; empty: none",
    ),
    Parameter(
        "start_paused", False, "It begins in a person's hands: the finger does not move before ~/resume or an order"
    ),
    Parameter("mesh", "", "Mesh that a person sees and points at, in object_frame_id; empty: none"),
    Parameter("base_frame_id", BASE_FRAME, "Frame in which the arm stands"),
    Parameter("object_frame_id", TRUTH_FRAME, "Frame of the object that a person sees, as of digit_sim"),
    Parameter("sensor_frame_id", GEL_FRAME, "Gel frame"),
    Parameter(
        "give_up_after",
        120.0,
        "It gives up after this time without an answer that it can use",
        "s",
        minimum=1.0,
        maximum=3600.0,
    ),
)
