"""Base class of this project's nodes."""

from __future__ import annotations

import copy
from collections.abc import Callable

from rclpy.exceptions import ParameterException
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.subscription import Subscription

from ..errors import InputError

_OWN_OF_RCLPY = ("/parameter_events", "/clock")


class PipelineNode(Node):
    """Node whose QoS can be overridden by parameters such as `qos_overrides.TOPIC.publisher.reliability`.

    TOPIC is the full name; the policies are history, depth and reliability. Raises InputError for a value that a policy
    does not have.
    """

    def __init__(self, *args, **options) -> None:
        super().__init__(*args, **options)
        # After Jazzy, a context that is shut down destroys the nodes that are left, including nodes whose constructor
        # failed; of these `destroy_node` would find only a part.
        if hasattr(self.context, "untrack_node"):
            self.context.untrack_node(self)

    def create_publisher(self, msg_type: type, topic: str, qos_profile: QoSProfile | int, **options) -> Publisher:
        """Create a publisher as rclpy does; the QoS can be overridden by parameters."""
        return self._overridable(super().create_publisher, msg_type, topic, (), qos_profile, options)

    def create_subscription(
        self, msg_type: type, topic: str, callback: Callable, qos_profile: QoSProfile | int, **options
    ) -> Subscription:
        """Create a subscription as rclpy does; the QoS can be overridden by parameters."""
        return self._overridable(super().create_subscription, msg_type, topic, (callback,), qos_profile, options)

    def _overridable(
        self, create, msg_type: type, topic: str, arguments: tuple, qos_profile: QoSProfile | int, options: dict
    ):
        if topic not in _OWN_OF_RCLPY:
            options.setdefault("qos_overriding_options", QoSOverridingOptions.with_default_policies())
        try:
            # a copy: rclpy writes the overrides into the profile, which other topics use, too
            return create(msg_type, topic, *arguments, copy.copy(qos_profile), **options)
        except (ParameterException, RuntimeError) as error:
            if isinstance(error, ParameterException) or "QoS override" in str(error):
                raise InputError(f"{self.get_name()}: qos_overrides of {topic}: {error}") from error
            raise


def refuse_unused_overrides(node: Node) -> None:
    """Raise InputError for an override in the YAML file or on the command line that the node does not have.

    Call it when the node is complete.
    """
    # rclpy keeps the overrides in this attribute only
    unused = sorted(name for name in node._parameter_overrides if not node.has_parameter(name))
    if unused:
        known = ", ".join(sorted(name for name in node._parameters if name.startswith(unused[0].split(".")[0])))
        raise InputError(f"{node.get_name()}: no parameter '{unused[0]}'; known are {known or 'others'}")
