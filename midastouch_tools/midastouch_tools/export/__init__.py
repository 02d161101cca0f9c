"""Recordings in the formats of learning stacks; each format is a module that needs the `export` extra."""
