"""How well images are read: depth, contact, calibration, and the checks on them."""
