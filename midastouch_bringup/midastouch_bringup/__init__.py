"""Starts what the other packages offer: launch files, parameters, and all nodes in one process."""
