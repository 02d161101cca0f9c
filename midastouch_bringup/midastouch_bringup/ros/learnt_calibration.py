"""What a running filter has learnt about mount and clock, from its latched topic."""

from __future__ import annotations

from midastouch_common.errors import InputError
from midastouch_common.ros import qos
from midastouch_msgs.msg import ArmCalibration

from .local_context import node_for_once, spin_until


def learnt_calibration(namespace: str, patience: float = 10.0) -> ArmCalibration:
    """The message kept on `calibration` in the namespace; InputError if none comes within `patience` seconds."""
    received: list[ArmCalibration] = []
    with node_for_once("store_mount", namespace) as node:
        subscription = node.create_subscription(ArmCalibration, "calibration", received.append, qos.latched())
        if not spin_until(node, lambda: received, patience):
            raise InputError(
                f"{subscription.topic_name}: nothing is published there; is the filter running, with this "
                "ROS_DOMAIN_ID, and did it converge? Another namespace: --namespace"
            )
    return received[-1]
