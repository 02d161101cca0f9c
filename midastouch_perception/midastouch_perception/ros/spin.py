"""Run nodes until the process is told to stop; bad input ends it with one line."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable, Iterable, Sequence

from rclpy.node import Node

from digit_driver.ros import spin

from ..errors import InputError
from .managed_node import ManagedNode
from .node import refuse_unused_overrides


def run(make_nodes: Callable[[], Iterable[Node]], args: Sequence[str] | None = None) -> int:
    """As the driver's `spin.run`; InputError while the nodes are made ends the process with one line and code 2.

    Of nodes that come one by one the earlier ones are destroyed when a later one cannot be made.
    """
    try:
        return spin.run(lambda: _complete(make_nodes()), args)
    except InputError as error:
        print(error, file=sys.stderr)
        return 2


def _complete(nodes: Iterable[Node]) -> Sequence[Node]:
    """The nodes, unless one is told of parameters that it does not have."""
    made: list[Node] = []
    try:
        made.extend(nodes)
        for node in made:
            if not isinstance(node, ManagedNode):  # which are complete once active, and look themselves
                refuse_unused_overrides(node)
    except BaseException:
        for node in made:
            node.destroy_node()
        raise
    return made


def stop() -> None:
    """End `run` as a signal would; from any thread."""
    signal.raise_signal(signal.SIGTERM)
