"""The time of the nodes of the filter."""

from __future__ import annotations

import types

import pytest

from midastouch_filter.nodes.node_clock import NodeClock


@pytest.fixture
def timeout_clock(monkeypatch) -> types.SimpleNamespace:
    """The seconds `now` by which time-outs of filter nodes run, which the test moves."""
    clock = types.SimpleNamespace(now=0.0)
    monkeypatch.setattr(NodeClock, "now", lambda self: clock.now)
    return clock
