"""Exploration by an arm until the filter knows the pose: acts, plans of acts, decisions. Without ROS."""
