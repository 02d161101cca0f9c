"""The stand-ins beside this file can be imported."""

from __future__ import annotations

import sys
import types
from pathlib import Path

import pytest

from midastouch_filter.nodes.code_processor import NodeClock

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture
def timeout_clock(monkeypatch) -> types.SimpleNamespace:
    """The seconds `now` by which time-outs of filter nodes run, which the test moves."""
    clock = types.SimpleNamespace(now=0.0)
    monkeypatch.setattr(NodeClock, "now", lambda self: clock.now)
    return clock
