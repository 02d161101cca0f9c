"""The particle filter of the paper: particles, the measurement models, and one object they are about."""
