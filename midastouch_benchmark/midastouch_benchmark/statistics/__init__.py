"""Figures over trials, with their intervals, and what they say."""
