"""Times of the nodes, and an explorer."""

from __future__ import annotations

import types

import pytest


@pytest.fixture
def hasty(monkeypatch):
    """A finger at rest goes on, and diagnostics are published, ten times as often: the tests wait for both."""
    from midastouch_common.ros import diagnostics
    from midastouch_simulation.nodes import pace

    monkeypatch.setattr(pace, "AT_REST_S", 0.1)
    monkeypatch.setattr(diagnostics, "PERIOD_S", 0.1)


@pytest.fixture
def patience_clock(monkeypatch):
    """The seconds `now` by which patience runs out, which the test moves."""
    from midastouch_motion.nodes import arm_client, explorer, explorer_services

    clock = types.SimpleNamespace(now=0.0)
    for module in (arm_client, explorer, explorer_services):
        monkeypatch.setattr(module, "time", types.SimpleNamespace(monotonic=lambda: clock.now))
    return clock


@pytest.fixture
def rig(graph):
    """An explorer over the ball."""
    from explorer_rig import Rig

    return Rig(graph)
