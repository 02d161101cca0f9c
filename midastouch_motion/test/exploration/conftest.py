"""A finger over the ball."""

from __future__ import annotations

import numpy as np
import pytest

from midastouch_common.mesh import ObjectMesh
from midastouch_perception.objects import bundled_objects
from midastouch_perception.sensor_model import SensorModel
from midastouch_simulation.world import World

STEP = 1.5e-3


@pytest.fixture
def make_world():
    """Makes a finger over a bundled object."""

    def make(name: str, seed: int = 3) -> World:
        mesh = ObjectMesh.load(bundled_objects()[name])
        return World(mesh, SensorModel.load("digit_tacto"), np.random.default_rng(seed), STEP)

    return make


@pytest.fixture
def world(make_world):
    """A finger over the ball."""
    return make_world("ball")
