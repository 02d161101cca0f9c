"""Stand-ins that can be imported."""

from __future__ import annotations

import sys
import types
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
# The filter node's stand-ins are beside its own tests.
sys.path.insert(0, str(Path(__file__).parents[3] / "midastouch_filter/test/nodes"))


@pytest.fixture
def hasty(monkeypatch):
    """A finger at rest goes on, and diagnostics are published, ten times as often: the tests wait for both."""
    from midastouch_bringup.nodes import finger
    from midastouch_common.ros import diagnostics

    monkeypatch.setattr(finger, "AT_REST_S", 0.1)
    monkeypatch.setattr(diagnostics, "PERIOD_S", 0.1)


@pytest.fixture
def patience_clock(monkeypatch):
    """The seconds `now` by which patience runs out, which the test moves."""
    from midastouch_bringup.nodes import arm_client, explorer, explorer_filter

    clock = types.SimpleNamespace(now=0.0)
    for module in (arm_client, explorer, explorer_filter):
        monkeypatch.setattr(module, "time", types.SimpleNamespace(monotonic=lambda: clock.now))
    return clock
