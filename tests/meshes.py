"""Two meshes, and codebooks of them without a search for symmetries, for tests of several packages."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

import numpy as np
import pytest

from midastouch_common.mesh import ObjectMesh
from midastouch_perception.objects import bundled_objects
from midastouch_perception.symmetry.group import Symmetry
from midastouch_perception.symmetry.search import ObjectSymmetry
from midastouch_simulation.procedural import box, mesh_from_sdf


@pytest.fixture(scope="session")
def tool() -> ObjectMesh:
    return ObjectMesh.load(bundled_objects()["handle_tool"])


@pytest.fixture(scope="session")
def block() -> ObjectMesh:
    """A box of 40 x 30 x 20 mm with 2 mm round edges."""
    return mesh_from_sdf(box((0.02, 0.015, 0.01), 0.002), np.array([0.022, 0.017, 0.012]), 1e-3, "block")


@contextlib.contextmanager
def without_symmetry_search() -> Iterator[None]:
    """Codebooks have the symmetry that they are given, or none: to search for one takes longer than they do."""

    def given_or_none(mesh, sensor, poses, given=None, tried=None) -> ObjectSymmetry:
        return ObjectSymmetry(given or Symmetry(), given=given is not None)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("midastouch_perception.codebook_build.object_symmetry", given_or_none)
        yield


@pytest.fixture(scope="module")
def no_symmetry_search() -> Iterator[None]:
    with without_symmetry_search():
        yield
