"""The stand-ins beside this file can be imported."""

from __future__ import annotations

import sys
import types
from pathlib import Path

import pytest

from midastouch_filter.nodes import tf2_buffer
from midastouch_filter.nodes.node_clock import NodeClock

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture
def patience(monkeypatch) -> types.SimpleNamespace:
    """The seconds `now` by which time-outs of filter nodes run, which the test moves."""
    clock = types.SimpleNamespace(now=0.0)
    monkeypatch.setattr(NodeClock, "now", lambda self: clock.now)
    return clock


@pytest.fixture(params=["built-in", "tf2"])
def listening(request, graph, monkeypatch):
    """A source of transforms, over our own buffer and over tf2's."""
    import fake_tf2
    from transform_rig import Listening

    monkeypatch.setattr(tf2_buffer, "tf2_py", fake_tf2 if request.param == "tf2" else None)
    listening = Listening(graph)
    assert listening.source.name == request.param
    yield listening
    listening.source.close()
