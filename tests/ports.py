"""TCP ports for servers of the tests."""

from __future__ import annotations

import contextlib
import itertools
import os
import socket
from collections.abc import Iterator


def _of_this_run() -> Iterator[int]:
    """Ports that are free and stay so: no other run of tests takes them, nor the system for an outgoing connection."""
    for port in itertools.count(20_000 + 100 * int(os.environ["ROS_DOMAIN_ID"])):
        with contextlib.suppress(OSError):
            socket.create_server(("127.0.0.1", port)).close()
            yield port


_PORTS = _of_this_run()


def free_ports(n: int) -> list[int]:
    """So many, none twice."""
    return list(itertools.islice(_PORTS, n))
