"""Driver of the DIGIT tactile sensor, usable alone."""
