"""Message classes by their ROS names, and topics of a bag by those of the running nodes."""

from __future__ import annotations

import importlib

from midastouch_common.errors import InputError

from ..bags.messages import TF_STATIC_TOPIC, TF_TOPIC

_GLOBAL = (TF_TOPIC, TF_STATIC_TOPIC, "/diagnostics")


def message_class(type_name: str) -> type:
    """The class of a type such as `sensor_msgs/msg/Image`. Raises InputError if it is not installed."""
    try:
        package, kind, name = type_name.split("/")
        return getattr(importlib.import_module(f"{package}.{kind}"), name)
    except (ImportError, AttributeError, ValueError) as error:
        package = type_name.split("/")[0]
        raise InputError(f"message type '{type_name}' is not known here; install {package}") from error


def live_name(topic: str) -> str:
    """The name of a bag's topic in a node: relative to its namespace, as the live nodes use it, but for global ones."""
    return topic if topic in _GLOBAL else topic.lstrip("/")
