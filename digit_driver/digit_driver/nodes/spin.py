"""Run the driver's node until the process is told to stop, and leave cleanly."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Protocol

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor

from ..errors import InputError


class Driver(Protocol):
    """What ``run`` needs beside an rclpy node: ``failure`` says why the node gave up, empty while it works."""

    failure: str

    def destroy_node(self) -> None: ...


def run(make_node: Callable[[], Driver], args: list[str] | None = None) -> int:
    """Spins the node that ``make_node`` returns; the exit code for the process.

    2: unusable input (the node has logged it), 1: the node gave up, 0: told to stop by SIGINT or SIGTERM.
    """
    rclpy.init(args=args)
    executor = SingleThreadedExecutor()
    node = None
    try:
        node = make_node()
        executor.add_node(node)
        while rclpy.ok() and not node.failure:
            executor.spin_once()
    except InputError:
        return 2
    except KeyboardInterrupt:
        _let_the_handler_finish()
    except ExternalShutdownException:
        pass
    except RuntimeError:
        # A signal shuts the context down under whatever is being published or taken at that moment: an RCLError, or
        # a failed conversion where rclpy swallowed the interrupt.
        _let_the_handler_finish()
        if rclpy.ok():
            raise
    finally:
        executor.shutdown()
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
    return 1 if node is not None and node.failure else 0


def _let_the_handler_finish() -> None:
    """Waits until rclpy's signal handler, which may run in another thread, has shut the context down.

    It still walks the executors' guard conditions when Python raises KeyboardInterrupt; destroying them under it ends
    the process with a segmentation fault.
    """
    deadline = time.monotonic() + 1.0
    while rclpy.ok() and time.monotonic() < deadline:
        time.sleep(0.001)
