"""Run nodes until the process is told to stop, and leave cleanly."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node

from ..errors import InputError
from .managed_node import ManagedNode
from .node import refuse_unused_overrides


def run(make_nodes: Callable[[], Sequence[Node]], args: Sequence[str] | None = None) -> int:
    """Spin the nodes that `make_nodes` returns in one executor; the exit code for the process.

    `args` are the command line with its ROS arguments (None: the process' own). Bad input while the nodes are
    made ends the process with one line and exit code 2. SIGINT and SIGTERM end it with 0.
    """
    rclpy.init(args=args)
    executor = SingleThreadedExecutor()
    nodes: Sequence[Node] = ()
    try:
        nodes = make_nodes()
        for node in nodes:
            if not isinstance(node, ManagedNode):  # which are complete once they are active, and look themselves
                refuse_unused_overrides(node)
            executor.add_node(node)
        executor.spin()
    except InputError as error:
        print(error, file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        _let_the_handler_finish()
    except ExternalShutdownException:
        pass
    except RuntimeError:
        # A signal shuts the context down under whatever is being published or taken at that moment: an RCLError, or a
        # failed conversion where rclpy swallowed the interrupt.
        _let_the_handler_finish()
        if rclpy.ok():
            raise
    finally:
        executor.shutdown()
        for node in nodes:
            node.destroy_node()
        rclpy.try_shutdown()
    return 0


def _let_the_handler_finish() -> None:
    """Wait until rclpy's signal handler, which may run in another thread, has shut the context down.

    It still walks the executors' guard conditions when Python raises KeyboardInterrupt; to destroy them under
    it ends the process with a segmentation fault (once in 60 stops).
    """
    deadline = time.monotonic() + 1.0
    while rclpy.ok() and time.monotonic() < deadline:
        time.sleep(0.001)
