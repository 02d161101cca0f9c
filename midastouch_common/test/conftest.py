"""The object of the tests of meshes."""

import pytest
import trimesh

from midastouch_common.mesh import ObjectMesh


@pytest.fixture(scope="session")
def block() -> ObjectMesh:
    """A box of 40 x 30 x 20 mm in faces of some 2 mm."""
    box = trimesh.creation.box((0.04, 0.03, 0.02)).subdivide_to_size(3e-3)
    return ObjectMesh.from_arrays(box.vertices, box.faces, "block")
