"""Quality of the readings of tactile images: depth, contact, calibration, and the checks on them."""
