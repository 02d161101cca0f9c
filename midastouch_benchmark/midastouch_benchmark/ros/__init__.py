"""Measurements that need running nodes."""
