"""Offline evaluation: frame-exact runs, campaigns of trials, their figures, and the JSON files that hold them."""
