"""What a running filter has learnt about mount and clock, from its latched topic."""

from __future__ import annotations

import time

import rclpy
from rclpy.exceptions import InvalidNamespaceException
from rclpy.executors import SingleThreadedExecutor

from midastouch_msgs.msg import ArmCalibration
from midastouch_perception.errors import InputError
from midastouch_perception.ros import qos

from .local_context import started_context


def learnt_calibration(namespace: str, patience: float = 10.0) -> ArmCalibration:
    """The message kept on `calibration` in the namespace; InputError if none comes within `patience` seconds."""
    context, received = started_context(), []
    try:
        try:
            node = rclpy.create_node("store_mount", context=context, namespace=namespace)
        except InvalidNamespaceException as error:
            raise InputError(f"--namespace {namespace}: {error}") from error
        subscription = node.create_subscription(ArmCalibration, "calibration", received.append, qos.latched())
        executor = SingleThreadedExecutor(context=context)
        executor.add_node(node)
        end = time.monotonic() + patience
        while not received and (left := end - time.monotonic()) > 0:
            executor.spin_once(timeout_sec=left)
        if not received:
            raise InputError(
                f"{subscription.topic_name}: nothing is published there; is the filter running, with this "
                "ROS_DOMAIN_ID, and did it converge? Another namespace: --namespace"
            )
        return received[-1]
    finally:
        rclpy.try_shutdown(context=context)
