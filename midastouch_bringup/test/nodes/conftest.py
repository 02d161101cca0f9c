"""A ROS graph per test."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from midastouch_perception.ros.testing import Graph, open_graph

sys.path.insert(0, str(Path(__file__).parent))
# The filter node's stand-ins are beside its own tests.
sys.path.insert(0, str(Path(__file__).parents[3] / "midastouch_filter/test/nodes"))


@pytest.fixture
def graph() -> Iterator[Graph]:
    with open_graph() as opened:
        yield opened
