"""Run the driver's node until the process is told to stop, and leave cleanly."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions

from ..errors import InputError
from ..stop_signals import end_at_once, stop_event


class Driver(Protocol):
    """What ``run`` needs beside an rclpy node: ``failure`` says why the node gave up, empty while it works."""

    failure: str

    def destroy_node(self) -> None: ...


def run(make_node: Callable[[], Driver], args: list[str] | None = None) -> int:
    """Spins the node that ``make_node`` returns; the exit code for the process, which then ends.

    2: unusable input (the node has logged it), 1: the node gave up, 0: told to stop by SIGINT, SIGTERM or SIGHUP, at
    any moment and however often; what is going on then, the making of the node or a callback, is finished first.
    """
    end_at_once()
    rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    executor = SingleThreadedExecutor()
    node = None
    try:
        # a task lets spin_once return, which executor.wake() would not
        with stop_event(lambda: executor.create_task(lambda: None)) as stopping:
            node = make_node()
            executor.add_node(node)
            while not stopping.is_set() and not node.failure:
                executor.spin_once()
    except InputError:
        return 2
    finally:
        executor.shutdown()
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
    return 1 if node is not None and node.failure else 0
