"""What a running filter has learnt about mount and clock, from its latched topic."""

from __future__ import annotations

import rclpy
from rclpy.exceptions import InvalidNamespaceException

from midastouch_msgs.msg import ArmCalibration
from midastouch_perception.errors import InputError
from midastouch_perception.ros import qos

from .local_context import spin_until, started_context


def learnt_calibration(namespace: str, patience: float = 10.0) -> ArmCalibration:
    """The message kept on `calibration` in the namespace; InputError if none comes within `patience` seconds."""
    context, received = started_context(), []
    try:
        try:
            node = rclpy.create_node("store_mount", context=context, namespace=namespace)
        except InvalidNamespaceException as error:
            raise InputError(f"--namespace {namespace}: {error}") from error
        subscription = node.create_subscription(ArmCalibration, "calibration", received.append, qos.latched())
        if not spin_until(node, lambda: received, patience):
            raise InputError(
                f"{subscription.topic_name}: nothing is published there; is the filter running, with this "
                "ROS_DOMAIN_ID, and did it converge? Another namespace: --namespace"
            )
        return received[-1]
    finally:
        rclpy.try_shutdown(context=context)
