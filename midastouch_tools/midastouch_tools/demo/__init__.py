"""The demo: a simulated slide over a bundled object, played through the real nodes; its result and its page."""

SLIDE_LENGTH = 0.3  # m
SEED = 3
"""Seed of a slide over the jaws of the tool, long and varied enough to determine the pose."""

NODES = ("tdn", "tcn", "particle_filter")
"""Nodes that a recording passes through, in this order."""
