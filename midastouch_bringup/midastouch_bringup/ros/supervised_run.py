"""A run: its programs as processes, and nodes of our own that follow it, in a domain that only this machine sees."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

from rclpy.executors import SingleThreadedExecutor

from ..processes.local_domain import LogFolder, local_environment
from ..processes.supervisor import Supervisor
from .local_context import local_context


@contextlib.contextmanager
def supervised_run(domain: int, logs: Path) -> Iterator[tuple[Supervisor, SingleThreadedExecutor]]:
    """Who keeps the programs running, their output in a folder, and who spins our own nodes, made in its `context`.

    In the end the nodes that it was given are destroyed, then the programs ended.
    """
    environment = local_environment(domain, ROS_LOG_DIR=str(logs.resolve()))
    with local_context(domain) as context, Supervisor(environment, LogFolder(logs)) as supervisor:
        executor = SingleThreadedExecutor(context=context)
        try:
            yield supervisor, executor
        finally:
            nodes = executor.get_nodes()
            executor.shutdown()
            for node in nodes:
                node.destroy_node()
