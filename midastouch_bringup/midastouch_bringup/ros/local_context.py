"""ROS for our own use beside processes of ours: in their domain, and like them heard on this machine alone."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator

import rclpy
from rclpy.signals import SignalHandlerOptions

from ..processes.local_domain import local_environment


@contextlib.contextmanager
def local_context(domain: int) -> Iterator[rclpy.Context]:
    """A context in the domain of `local_environment`, which becomes ours; signals are left to others."""
    os.environ.update(local_environment(domain))  # DDS takes it from there alone
    context = rclpy.Context()
    rclpy.init(args=[], context=context, domain_id=domain, signal_handler_options=SignalHandlerOptions.NO)
    try:
        yield context
    finally:
        rclpy.try_shutdown(context=context)
