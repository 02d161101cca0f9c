"""What a gel measures at a pose: contact poses on a mesh, and the penetration maps that are rendered there."""
