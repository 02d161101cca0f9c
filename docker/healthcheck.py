#!/usr/bin/env python3
"""Exit with 0 if every named node reports on /diagnostics within the time, with 1 otherwise.

    healthcheck.py [--timeout SECONDS] NODE...

A live node reports once a second (REP 107), whether or not a sensor is plugged in: the check finds processes that hang,
not those that have nothing to do.
"""

import argparse
import sys
import time

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import SingleThreadedExecutor


def silent_nodes(names: set[str], timeout: float, context: rclpy.Context) -> set[str]:
    """Return those of `names` from which no status came within `timeout` seconds."""
    missing = set(names)

    def heard(message: DiagnosticArray) -> None:
        missing.difference_update(s.name.partition(":")[0] for s in message.status)  # "name: full name"

    node = rclpy.create_node("healthcheck", context=context)
    node.create_subscription(DiagnosticArray, "/diagnostics", heard, 50)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    end = time.monotonic() + timeout
    while missing and (left := end - time.monotonic()) > 0:
        executor.spin_once(timeout_sec=left)
    executor.shutdown()
    node.destroy_node()
    return missing


def main() -> int:
    """Run the check and return its exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("nodes", nargs="+", metavar="NODE")
    parser.add_argument("--timeout", type=float, default=8.0, help="seconds (default: 8)")
    arguments = parser.parse_args()
    context = rclpy.Context()
    rclpy.init(context=context)
    missing = silent_nodes(set(arguments.nodes), arguments.timeout, context)
    context.shutdown()
    if missing:
        print(f"silent for {arguments.timeout:g} s: {', '.join(sorted(missing))}", file=sys.stderr)
    return 1 if missing else 0


if __name__ == "__main__":
    sys.exit(main())
