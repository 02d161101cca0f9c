"""Frames in our recordings, which are the defaults of what publishes transforms in simulation."""

from .se3 import translation

BASE_FRAME = "base_link"
GEL_FRAME = "digit_gel_frame"
OPTICAL_FRAME = "digit_optical_frame"
TRUTH_FRAME = "object_ground_truth"
TRUTH_GEL_FRAME = "digit_gel_ground_truth"

BASE_FROM_OBJECT = translation([0.4, -0.15, 0.25])
"""Pose T_base_obj (4, 4) of a simulated object, metres."""
