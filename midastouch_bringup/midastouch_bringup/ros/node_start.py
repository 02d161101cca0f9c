"""How long the filter's process takes from its start until it is active, and how much memory it then has."""

from __future__ import annotations

import os
import tempfile
import time
from pathlib import Path

import rclpy
import yaml
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from midastouch_perception.errors import InputError
from midastouch_perception.ros.lifecycle_watch import LifecycleWatch

from ..node_processes import NodeProcesses, resident_mb

_NODE = "particle_filter"
_PATIENCE_S = 300.0


def node_start(mesh: Path, codebook: Path, repeats: int = 5) -> dict:
    """filter_start_s {p50, max}: from the start of a process of its own until the filter is active on an object, as
    another process hears it; filter_rss_mb: its resident memory then, MiB, the largest of the repeats.

    Raises InputError if it does not become active, NodeFailed if it ends.
    """
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    domain = int(os.environ.get("ROS_DOMAIN_ID", 1 + os.getpid() % 101))
    settings = {_NODE: {"ros__parameters": {"mesh": str(mesh.resolve()), "codebook": str(codebook.resolve())}}}
    seconds, memory = [], []
    for _ in range(repeats):
        with tempfile.TemporaryDirectory() as folder:
            parameters = Path(folder, "filter.yaml")
            parameters.write_text(yaml.safe_dump(settings))
            with NodeProcesses(Path(folder), domain) as processes:
                begin = time.monotonic()
                processes.start(_NODE, parameters)
                _await_active(processes, domain)
                seconds.append(time.monotonic() - begin)
                memory.append(resident_mb(processes.pids[_NODE]))
    seconds.sort()
    start = {"p50": round(seconds[len(seconds) // 2], 3), "max": round(seconds[-1], 3)}
    return {"filter_start_s": start, "filter_rss_mb": round(max(memory), 1)}


def _await_active(processes: NodeProcesses, domain: int) -> None:
    context = rclpy.Context()
    rclpy.init(args=[], context=context, domain_id=domain, signal_handler_options=SignalHandlerOptions.NO)
    node = Node("node_start", context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    try:
        watch = LifecycleWatch(node, [_NODE])
        deadline = time.monotonic() + _PATIENCE_S
        while watch.waiting_for:
            processes.check(_NODE)
            if time.monotonic() > deadline:
                raise InputError(f"{watch.waiting_for} after {_PATIENCE_S:.0f} s: does DDS work?")
            executor.spin_once(timeout_sec=0.1)
    finally:
        executor.shutdown()
        node.destroy_node()
        rclpy.try_shutdown(context=context)
