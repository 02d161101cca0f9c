"""One call of a service without arguments, for those who have no `ros2`."""

from __future__ import annotations

from std_srvs.srv import Trigger

from midastouch_common.errors import InputError

from .local_context import node_for_once, spin_until

_LONGEST = 660.0  # s that a node may take for its answer: `capture_timeout` is at most 600


def trigger(service: str, namespace: str, patience: float = 30.0) -> Trigger.Response:
    """What the service `service` in the namespace answers; InputError if nobody offers it within `patience` seconds."""
    with node_for_once(f"call_{service}", namespace) as node:
        client = node.create_client(Trigger, service)
        if not spin_until(node, client.service_is_ready, patience):
            raise InputError(
                f"{client.service_name}: nobody offers this service; does its node run, with this ROS_DOMAIN_ID? "
                "Another namespace: --namespace"
            )
        answer = client.call_async(Trigger.Request())
        if not spin_until(node, answer.done, _LONGEST):
            raise InputError(f"{client.service_name}: no answer within {_LONGEST:g} s; see the log of its node")
        return answer.result()
