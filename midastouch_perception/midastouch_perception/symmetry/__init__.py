"""Symmetry of an object: motions that map it onto itself, so that touches cannot distinguish the poses they connect."""
