"""Nodes that stand for hardware: a simulated sensor, and what carries it."""
