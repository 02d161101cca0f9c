"""Offline evaluation: metrics, frame-exact runs, benchmarks, and the JSON files that hold their results."""
