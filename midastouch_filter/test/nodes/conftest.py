"""A ROS graph per test; the stand-ins beside this file can be imported."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from midastouch_perception.ros.testing import Graph, open_graph

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture
def graph() -> Iterator[Graph]:
    with open_graph() as opened:
        yield opened
