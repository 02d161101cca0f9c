"""The pictured run as the pictures see it."""

from __future__ import annotations

import numpy as np
import pytest

from midastouch_tools.drawing.object_view import ObjectView


@pytest.fixture(scope="session")
def view(ball, run) -> ObjectView:
    return ObjectView(ball, np.array([s.truth for s in run]), 120)
