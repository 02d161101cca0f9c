"""A source of transforms on a graph."""

from __future__ import annotations

import pytest


@pytest.fixture
def listening(graph):
    """A source of transforms."""
    from transform_rig import Listening

    listening = Listening(graph)
    yield listening
    listening.source.close()
