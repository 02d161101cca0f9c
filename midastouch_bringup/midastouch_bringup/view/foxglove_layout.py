"""The Foxglove layout: its topics are absolute, so each namespace needs one of its own."""

from __future__ import annotations


def in_namespace(layout: object, namespace: str) -> object:
    """A layout, or a part of one, whose topics are those of the nodes in `namespace`.

    Every text and key that begins with a slash is a topic, or a field of one.
    """
    if isinstance(layout, dict):
        return {in_namespace(key, namespace): in_namespace(value, namespace) for key, value in layout.items()}
    if isinstance(layout, list):
        return [in_namespace(value, namespace) for value in layout]
    if isinstance(layout, str) and layout.startswith("/") and (inside := namespace.strip("/")):
        return f"/{inside}{layout}"
    return layout
