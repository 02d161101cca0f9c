"""Offline evaluation: metrics, frame-exact runs, speed and accuracy, and the JSON files that hold their results."""
