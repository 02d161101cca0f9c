"""Fingerprint of today's code, by which committed reports are stale or not, and the plan that makes them again."""
