"""ROS contexts for our own use: a node for one question, or a context for a run on this machine alone."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Callable, Iterator

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from std_srvs.srv import Trigger

from midastouch_common.errors import InputError

from ..processes.local_domain import local_environment

_SOON_S = 2.0  # for a service that is there to be known
_SLICE_S = 0.1  # of spinning: Python handles signals only in between
_ANSWER_TIMEOUT_S = 660.0  # `capture_timeout` is at most 600


@contextlib.contextmanager
def own_context(domain: int | None = None) -> Iterator[rclpy.Context]:
    """Provide a context in a domain (None: that of the environment), which handles no signals.

    Raises InputError if ROS does not start.
    """
    context = rclpy.Context()
    try:
        rclpy.init(args=[], context=context, domain_id=domain, signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:  # of a type of rclpy's, without a public name
        raise InputError(
            f"ROS does not start: {error}; can logs be written to $ROS_LOG_DIR, or without it to ~/.ros/log?"
        ) from error
    try:
        yield context
    finally:
        rclpy.try_shutdown(context=context)


@contextlib.contextmanager
def local_context(domain: int) -> Iterator[rclpy.Context]:
    """Provide a context as `own_context` does, in a domain that only this machine sees; changes our environment."""
    os.environ.update(local_environment(domain))  # DDS reads it only from there
    with own_context(domain) as context:
        yield context


def spin_until(node: Node, done: Callable[[], object], timeout: float) -> bool:
    """Spin a node until `done` holds, at most `timeout` seconds; return whether it holds. Ctrl-C ends this at once."""
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    end = time.monotonic() + timeout
    while not done() and (left := end - time.monotonic()) > 0:
        executor.spin_once(timeout_sec=min(left, _SLICE_S))
    return bool(done())


def trigger(service: str, offered_by: str, namespace: str, timeout: float = 30.0) -> Trigger.Response:
    """Call a service in the namespace; return its answer. InputError if it is not offered within `timeout` seconds.

    offered_by: the command that starts a node with it, for messages.
    """
    with own_context() as context:
        node = rclpy.create_node(f"call_{service}", context=context, namespace=namespace)
        client = node.create_client(Trigger, service)
        if not spin_until(node, client.service_is_ready, min(_SOON_S, timeout)):
            print(f"waiting for {client.service_name}, which {offered_by} offers", flush=True)
        if not spin_until(node, client.service_is_ready, timeout - _SOON_S):
            raise InputError(
                f"{client.service_name}: no node offers this service; start {offered_by} with this ROS_DOMAIN_ID. "
                "Another namespace: --namespace"
            )
        answer = client.call_async(Trigger.Request())
        if not spin_until(node, answer.done, _ANSWER_TIMEOUT_S):
            late = f"no answer within {_ANSWER_TIMEOUT_S:g} s"
            raise InputError(f"{client.service_name}: {late}; see the log of its node")
        return answer.result()
