"""Two meshes, for tests of several packages."""

from __future__ import annotations

import numpy as np
import pytest

from midastouch_common.mesh import ObjectMesh
from midastouch_perception.objects import bundled_objects
from midastouch_simulation.procedural import box, mesh_from_sdf


@pytest.fixture(scope="session")
def tool() -> ObjectMesh:
    return ObjectMesh.load(bundled_objects()["handle_tool"])


@pytest.fixture(scope="session")
def block() -> ObjectMesh:
    """A box of 40 x 30 x 20 mm with 2 mm round edges."""
    return mesh_from_sdf(box((0.02, 0.015, 0.01), 0.002), np.array([0.022, 0.017, 0.012]), 1e-3, "block")
