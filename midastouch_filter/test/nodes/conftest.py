"""A ROS graph per test; the stand-ins beside this file can be imported."""

from __future__ import annotations

import sys
import types
from collections.abc import Iterator
from pathlib import Path

import pytest

from midastouch_filter.nodes.node_clock import NodeClock
from midastouch_perception.ros.testing import Graph, open_graph

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture
def graph() -> Iterator[Graph]:
    with open_graph() as opened:
        yield opened


@pytest.fixture
def patience(monkeypatch) -> types.SimpleNamespace:
    """The seconds `now` by which time-outs of filter nodes run, which the test moves."""
    clock = types.SimpleNamespace(now=0.0)
    monkeypatch.setattr(NodeClock, "now", lambda self: clock.now)
    return clock
