"""Meshes and networks shared by the perception tests."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from midastouch_perception.mesh import ObjectMesh
from midastouch_perception.objects import bundled_objects
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.simulation.procedural import box, mesh_from_sdf

SHARED = Path(__file__).resolve().parents[3] / "shared"


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of scans and slides beside the clone."""
    if not SHARED.is_dir():
        pytest.skip("no ../shared folder beside the clone")
    return SHARED


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
