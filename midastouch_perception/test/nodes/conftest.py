"""A ROS graph per test."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from midastouch_perception.ros.testing import Graph, open_graph


@pytest.fixture
def graph() -> Iterator[Graph]:
    with open_graph() as opened:
        yield opened
