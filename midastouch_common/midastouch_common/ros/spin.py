"""Runner of nodes: a signal stops the process, and bad input ends it with one line."""

from __future__ import annotations

import contextlib
import signal
import sys
import warnings
from collections.abc import Callable, Iterable, Sequence

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from ..errors import EXIT_BAD_INPUT, InputError
from ..stop_signals import Stopped, end_at_once, stop_event
from .managed_node import ManagedNode
from .node import refuse_unused_overrides

_ROS_FIX = "check what follows --ros-args, and that logs can be written: $ROS_LOG_DIR, or without it ~/.ros/log"


def run(make_nodes: Callable[[], Iterable[Node]], args: list[str] | None = None) -> int:
    """Spin the nodes that `make_nodes` returns in one executor, and return the exit code of the process.

    If `make_nodes` is a generator and a later node cannot be made, the earlier ones are destroyed. `args`: the command
    line with its ROS arguments (None: the process' own). Other errors than InputError from `make_nodes` are raised.

    Exit code 0: stopped by SIGINT, SIGTERM or SIGHUP, at any moment and any number of them; the making of the nodes or
    the present callback is finished first, but loading is broken off. 1: a node set its attribute `gave_up`. 2:
    InputError, or ROS does not start; the reason is printed in one line.
    """
    try:
        return _spin(make_nodes, args)
    except InputError as error:
        print(error, file=sys.stderr)
        return EXIT_BAD_INPUT


def stop() -> None:
    """End `run` as a signal does; you can call this from any thread."""
    signal.raise_signal(signal.SIGTERM)


def _spin(make_nodes: Callable[[], Iterable[Node]], args: list[str] | None) -> int:
    end_at_once()
    warnings.filterwarnings("ignore", "failed to send response", RuntimeWarning)  # its client has gone: no harm done
    try:
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:  # base of several types of rclpy that have no public name
        print(f"ROS does not start: {' '.join(str(error).split())}; {_ROS_FIX}", file=sys.stderr)
        return EXIT_BAD_INPUT
    executor = SingleThreadedExecutor()
    nodes: Sequence[Node] = ()
    try:
        # a task makes spin_once return, which executor.wake() does not
        stops = stop_event(lambda: executor.create_task(lambda: None))
        with stops as stopping, contextlib.suppress(Stopped):
            nodes = _complete(make_nodes())
            for node in nodes:
                executor.add_node(node)
            while not stopping.is_set() and not _gave_up(nodes):
                executor.spin_once()
    finally:
        executor.shutdown()
        for node in nodes:
            node.destroy_node()
        rclpy.try_shutdown()
    return int(_gave_up(nodes))


def _gave_up(nodes: Sequence[Node]) -> bool:
    return any(getattr(node, "gave_up", False) for node in nodes)


def _complete(nodes: Iterable[Node]) -> Sequence[Node]:
    """Return the nodes; InputError if one is given parameters that it does not have. On errors all are destroyed."""
    made: list[Node] = []
    try:
        made.extend(nodes)
        for node in made:
            if not isinstance(node, ManagedNode):  # a ManagedNode is complete once it is active, and checks this itself
                refuse_unused_overrides(node)
    except BaseException:
        for node in made:
            node.destroy_node()
        raise
    return made
