"""Meshes, networks and a real sensor shared by the perception tests."""

from __future__ import annotations

import numpy as np
import pytest

from midastouch_common.mesh import ObjectMesh
from midastouch_perception.objects import bundled_objects
from midastouch_perception.sensor_calibration.ball import ball_centre, ball_penetration
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.simulation.procedural import box, mesh_from_sdf
from midastouch_perception.state_dict import random_state
from midastouch_perception.tcn import TactileCodeNet, load_tcn, minkloc3d_network


@pytest.fixture(scope="session")
def sensor() -> SensorModel:
    return SensorModel.load("digit_tacto")


@pytest.fixture(scope="session")
def tool() -> ObjectMesh:
    return ObjectMesh.load(bundled_objects()["handle_tool"])


@pytest.fixture(scope="session")
def block() -> ObjectMesh:
    """A box of 40 x 30 x 20 mm with 2 mm round edges."""
    return mesh_from_sdf(box((0.02, 0.015, 0.01), 0.002), np.array([0.022, 0.017, 0.012]), 1e-3, "block")


@pytest.fixture(scope="session")
def minkloc_state() -> dict[str, np.ndarray]:
    """Random weights of MinkLoc3D under their official names."""
    return random_state(minkloc3d_network.expected_shapes(), np.random.default_rng(0))


@pytest.fixture(scope="session")
def tcn() -> TactileCodeNet:
    return load_tcn("fast")


@pytest.fixture(scope="session")
def real():
    """At half resolution."""
    return SensorModel.load("digit_real").scaled(0.5)


@pytest.fixture(scope="session")
def cap(real):
    """Penetration map (160, 120) m of a ball of 4 mm radius that touches in a circle of 2 mm."""
    return np.maximum(ball_penetration(ball_centre(60, 80, 2e-3, 4e-3, real), 4e-3, real), 0)
