"""Names of the frames in our recordings, and the defaults of what publishes transforms in simulation."""

BASE_FRAME = "base_link"
GEL_FRAME = "digit_gel_frame"
OPTICAL_FRAME = "digit_optical_frame"
TRUTH_FRAME = "object_ground_truth"
TRUTH_GEL_FRAME = "digit_gel_ground_truth"
