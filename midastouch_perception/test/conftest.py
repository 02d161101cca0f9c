"""Meshes, networks and a real sensor shared by the perception tests."""

from __future__ import annotations

import numpy as np
import pytest

from midastouch_perception.state_dict import random_state
from midastouch_perception.tcn import TactileCodeNet, load_tcn, minkloc3d_network


@pytest.fixture(scope="session")
def minkloc_state() -> dict[str, np.ndarray]:
    """Random weights of MinkLoc3D under their official names."""
    return random_state(minkloc3d_network.expected_shapes(), np.random.default_rng(0))


@pytest.fixture(scope="session")
def tcn() -> TactileCodeNet:
    return load_tcn("fast")
