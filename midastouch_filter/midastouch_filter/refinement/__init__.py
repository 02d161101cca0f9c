"""Alignment of narrow modes to the penetration maps of the present frame."""
