"""Exploration by an arm until the filter knows where it is: decisions, a simulated finger, what comes out, its page."""
