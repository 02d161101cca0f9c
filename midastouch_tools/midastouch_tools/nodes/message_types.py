"""Message classes by ROS name, and the running nodes' names for the topics of a bag."""

from __future__ import annotations

import importlib

from midastouch_common.errors import InputError

from ..bags.messages import TF_STATIC_TOPIC, TF_TOPIC

_GLOBAL = (TF_TOPIC, TF_STATIC_TOPIC, "/diagnostics")


def message_class(type_name: str) -> type:
    """Return the class of a type such as `sensor_msgs/msg/Image`. Raises InputError if it is not installed."""
    try:
        package, kind, name = type_name.split("/")
        return getattr(importlib.import_module(f"{package}.{kind}"), name)
    except (ImportError, AttributeError, ValueError) as error:
        package = type_name.split("/")[0]
        raise InputError(f"message type '{type_name}' is not known here; install {package}") from error


def live_name(topic: str) -> str:
    """Return a bag topic's name in a node: relative to the namespace, as live nodes use it, except for global ones."""
    return topic if topic in _GLOBAL else topic.lstrip("/")
