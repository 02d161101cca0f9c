"""Stand-ins that can be imported."""

from __future__ import annotations

import sys
import types
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture
def hasty(monkeypatch):
    """A finger at rest goes on, and diagnostics are published, ten times as often: the tests wait for both."""
    from midastouch_common.ros import diagnostics
    from midastouch_simulation.nodes import simulated_finger

    monkeypatch.setattr(simulated_finger, "AT_REST_S", 0.1)
    monkeypatch.setattr(diagnostics, "PERIOD_S", 0.1)


@pytest.fixture
def patience_clock(monkeypatch):
    """The seconds `now` by which patience runs out, which the test moves."""
    from midastouch_motion.nodes import arm_client, explorer, explorer_filter

    clock = types.SimpleNamespace(now=0.0)
    for module in (arm_client, explorer, explorer_filter):
        monkeypatch.setattr(module, "time", types.SimpleNamespace(monotonic=lambda: clock.now))
    return clock


@pytest.fixture
def rig(graph):
    """An explorer over the ball."""
    from explorer_rig import Rig

    return Rig(graph)
