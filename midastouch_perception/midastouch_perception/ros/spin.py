"""Run nodes until the process is told to stop, and leave cleanly."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable, Sequence

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from digit_driver.stop_signals import end_at_once, stop_event

from ..errors import InputError
from .managed_node import ManagedNode
from .node import refuse_unused_overrides


def run(make_nodes: Callable[[], Sequence[Node]], args: Sequence[str] | None = None) -> int:
    """Spin the nodes that `make_nodes` returns in one executor; the exit code for the process, which then ends.

    `args` are the command line with its ROS arguments (None: the process' own). Bad input while the nodes are
    made ends the process with one line and exit code 2. SIGINT, SIGTERM and SIGHUP, at any moment and however
    often, end it with 0; what is going on then, the making of the nodes or a callback, is finished first.
    """
    end_at_once()
    rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    executor = SingleThreadedExecutor()
    nodes: Sequence[Node] = ()
    try:
        # a task lets spin_once return, which executor.wake() would not
        with stop_event(lambda: executor.create_task(lambda: None)) as stopping:
            nodes = make_nodes()
            for node in nodes:
                if not isinstance(node, ManagedNode):  # which are complete once active, and look themselves
                    refuse_unused_overrides(node)
                executor.add_node(node)
            while not stopping.is_set():
                executor.spin_once()
    except InputError as error:
        print(error, file=sys.stderr)
        return 2
    finally:
        executor.shutdown()
        for node in nodes:
            node.destroy_node()
        rclpy.try_shutdown()
    return 0


def stop() -> None:
    """End `run` as a signal would; from any thread."""
    signal.raise_signal(signal.SIGTERM)
