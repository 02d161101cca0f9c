"""Parameters of the node `simulated_finger`."""

from __future__ import annotations

from midastouch_common.frames import BASE_FRAME, GEL_FRAME, TRUTH_FRAME
from midastouch_common.ros.parameters import Parameter

PARAMETERS = (
    Parameter("mesh", "", "Mesh of the object, metres: a path or package://NAME/...; must be given"),
    Parameter("sensor_model", "digit_tacto", "Geometry of the sensor, as of digit_sim"),
    Parameter("seed", 0, "Of where the finger begins, and how steady it is", minimum=0, maximum=2**31 - 1),
    Parameter("fps", 30.0, "As of digit_sim: one pose per image", minimum=1.0, maximum=240.0),
    Parameter("speed", 0.05, "Of the finger on the surface", "m/s", minimum=1e-3, maximum=0.3),
    Parameter(
        "untouched_frames",
        32,
        "Answered images of the untouched sensor before it moves: as many as tdn estimates its background from",
        minimum=1,
        maximum=1000,
    ),
    Parameter("base_frame_id", BASE_FRAME, "Frame in which the arm stands"),
    Parameter("object_frame_id", TRUTH_FRAME, "Frame of the object where it really is, as of digit_sim"),
    Parameter("sensor_frame_id", GEL_FRAME, "Gel frame, as of digit_sim"),
)
