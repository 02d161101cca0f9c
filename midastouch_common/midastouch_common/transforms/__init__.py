"""Rigid transforms as numbers, and the queue of items that wait for a transform."""
