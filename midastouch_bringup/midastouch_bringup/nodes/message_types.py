"""Message classes by their ROS names."""

from __future__ import annotations

import importlib

from midastouch_perception.errors import InputError


def message_class(type_name: str) -> type:
    """The class of a type such as `sensor_msgs/msg/Image`. Raises InputError if it is not installed."""
    try:
        package, kind, name = type_name.split("/")
        return getattr(importlib.import_module(f"{package}.{kind}"), name)
    except (ImportError, AttributeError, ValueError) as error:
        package = type_name.split("/")[0]
        raise InputError(f"message type '{type_name}' is not known here; install {package}") from error
