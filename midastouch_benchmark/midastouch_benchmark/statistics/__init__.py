"""Figures over trials, with their intervals."""
