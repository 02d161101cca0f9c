"""Nodes of recordings and pictures."""
