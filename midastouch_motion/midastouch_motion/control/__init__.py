"""Motions in contact: skills, the servo that keeps depth and tilt, the guard that stops, the controller over them."""
