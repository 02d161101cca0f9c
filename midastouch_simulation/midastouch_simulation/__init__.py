"""A simulated tactile sensor: optics, slides and grasps, shapes made by code, and training on them."""
