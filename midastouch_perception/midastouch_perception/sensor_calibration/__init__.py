"""Calibration of one sensor: the relation of its colours to slopes, found from presses of a ball and kept in a file."""
