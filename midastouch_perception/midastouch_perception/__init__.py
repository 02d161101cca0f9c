"""From tactile images to codes: depth, contact, point clouds, simulator, codebooks, training."""
