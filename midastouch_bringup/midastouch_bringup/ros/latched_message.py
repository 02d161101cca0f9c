"""The last message of a latched topic, for a command that needs no more than that."""

from __future__ import annotations

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from midastouch_perception.errors import InputError
from midastouch_perception.ros import qos


def latched_message(kind: type, topic: str, namespace: str = "", patience: float = 10.0):
    """The message that is kept on `topic` (relative to `namespace`); InputError if none comes within `patience` s."""
    context = rclpy.Context()
    rclpy.init(args=[], context=context, signal_handler_options=SignalHandlerOptions.NO)
    try:
        node = rclpy.create_node(
            "midastouch_reader", namespace=namespace, context=context, start_parameter_services=False
        )
        executor, received = SingleThreadedExecutor(context=context), Future()
        executor.add_node(node)
        subscription = node.create_subscription(kind, topic, received.set_result, qos.latched())
        executor.spin_until_future_complete(received, timeout_sec=patience)
        if not received.done():
            raise InputError(
                f"{subscription.topic_name}: nothing is published there; is the node running, in this ROS_DOMAIN_ID, "
                "and did it converge? Another namespace: --namespace"
            )
        return received.result()
    finally:
        rclpy.try_shutdown(context=context)
