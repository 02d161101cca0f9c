"""Comparison of pose hypotheses over the last touches."""
