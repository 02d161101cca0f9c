"""The stand-ins beside this file can be imported."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture
def listening(graph):
    """A source of transforms."""
    from transform_rig import Listening

    listening = Listening(graph)
    yield listening
    listening.source.close()
