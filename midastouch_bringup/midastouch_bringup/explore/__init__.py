"""Exploration by an arm until the filter knows the object's pose: decisions, a simulated finger, result and page."""
