"""Suggestions of where to touch next."""
