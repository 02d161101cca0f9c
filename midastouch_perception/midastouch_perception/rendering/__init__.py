"""Contact poses on a mesh, and rendering of the penetration maps that a gel measures there."""
