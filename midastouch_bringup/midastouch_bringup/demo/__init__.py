"""The demo: a simulated slide over a bundled object, played through the real nodes; what comes out, and its page."""

SLIDE_LENGTH = 0.3  # m
SEED = 3
"""Of a slide over the jaws of the tool: long and varied enough to know the pose for sure."""

NODES = ("tdn", "tcn", "particle_filter")
"""What a recording goes through, in this order."""
