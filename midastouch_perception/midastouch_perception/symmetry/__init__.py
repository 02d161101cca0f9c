"""Which motions map an object onto itself, so that no touch tells the poses apart that they map onto each other."""
