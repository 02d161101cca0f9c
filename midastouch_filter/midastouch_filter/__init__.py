"""Particle filter over the pose of the sensor on a known object."""
