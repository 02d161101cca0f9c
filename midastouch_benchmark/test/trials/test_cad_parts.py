import numpy as np
import pytest
import trimesh
from cad_symmetries import EXACT, NEAR

from midastouch_benchmark.trials.cad_parts import CAD_PARTS, SMALL_CAD_PARTS, write_parts
from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh
from midastouch_perception.codebook import codebook_poses
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.symmetry.group import Symmetry
from midastouch_perception.symmetry.search import ObjectSymmetry, object_symmetry

PARTS = CAD_PARTS | SMALL_CAD_PARTS
SAME = 1e-4  # m
TURNS = 7  # asked of a free turn about an axis
every_part = pytest.mark.parametrize("name", PARTS)


def moved_distances(mesh: ObjectMesh, motion: np.ndarray) -> np.ndarray:
    """Distances (N,) of the surface, moved by (4, 4), to itself."""
    points, _, _ = mesh.sample_surface(8000, np.random.default_rng(0))
    return mesh.closest_points(points @ motion[:3, :3].T + motion[:3, 3])[1]


def look_alikes(name: str) -> list[np.ndarray]:
    return [each for each in NEAR[name].turned(TURNS) if EXACT[name].distance(np.eye(4)[None], each)[0] > SAME]


def holds(group: Symmetry, motion: np.ndarray) -> bool:
    """Whether a motion (4, 4) is one of the group's, to 1 mm and 1 deg."""
    (nearest,) = group.nearest(np.eye(4)[None], motion)
    off = se3.inverse(nearest) @ motion
    return np.linalg.norm(off[:3, 3]) < 1e-3 and se3.rotation_angle(off[:3, :3]) < np.radians(1)


def test_sets_are_as_large_as_their_objects_should_be():
    assert len(CAD_PARTS) >= 22
    assert len(SMALL_CAD_PARTS) >= 8
    for parts, low, high in ((CAD_PARTS, 0.05, 0.16), (SMALL_CAD_PARTS, 0.012, 0.025)):
        sizes = [np.ptp(make(name).bounds, axis=0).max() for name, make in parts.items()]
        assert low < min(sizes)
        assert max(sizes) < high


@every_part
def test_a_part_is_closed_and_its_faces_look_outward(name):
    mesh = PARTS[name](name)
    solid = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    assert solid.is_watertight
    assert solid.is_winding_consistent
    assert solid.volume > 0
    assert len(trimesh.graph.connected_components(solid.face_adjacency)) == 1
    (up,) = mesh.face_normals[[np.argmax(mesh.vertices[mesh.faces].mean(axis=1)[:, 2])]]
    assert up[2] > 0.9


def test_files_of_parts_are_the_same_each_time(tmp_path):
    first, second = (write_parts(PARTS, tmp_path / folder) for folder in "ab")
    assert [mesh.sha256 for mesh in first] == [mesh.sha256 for mesh in second]
    assert [mesh.name for mesh in first] == list(PARTS)
    assert len({mesh.sha256 for mesh in first}) == len(PARTS)


@every_part
def test_the_known_group_maps_a_part_onto_itself(name):
    mesh = PARTS[name](name)
    for motion in EXACT[name].turned(TURNS):
        assert moved_distances(mesh, motion).max() < SAME


@every_part
def test_the_known_group_is_one(name):
    for group in filter(None, (EXACT[name], NEAR.get(name))):
        assert all(holds(group, first @ second) for first in group.transforms for second in group.transforms)


@pytest.mark.parametrize("name", NEAR)
def test_nearly_symmetric_parts_differ_on_a_small_part(name):
    mesh, motions = PARTS[name](name), look_alikes(name)
    assert motions
    for motion in motions:
        distances = moved_distances(mesh, motion)
        assert distances.max() > 0.7e-3  # twice what a map tells
        assert 0.02 < (distances > 3 * SAME).mean() < 0.13


def test_no_turn_makes_a_mirror_image():
    left, right = (PARTS[name](name) for name in ("bracket_left", "bracket_right"))
    points, _, _ = left.sample_surface(4000, np.random.default_rng(0))
    assert right.closest_points(points * [-1, 1, 1])[1].max() < SAME
    corners = left.vertices[left.faces].mean(axis=(0, 1))
    # the only turns that keep the sheet flat and its long leg along x
    for signs in ([1, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]):
        off = points * signs - corners * signs + right.vertices[right.faces].mean(axis=(0, 1))
        assert right.closest_points(off)[1].max() > 5e-3


@pytest.mark.slow
@every_part
def test_the_search_finds_the_known_group(name):
    mesh, exact, sensor = PARTS[name](name), EXACT[name], SensorModel.load("digit_tacto")
    found: ObjectSymmetry = object_symmetry(mesh, sensor, codebook_poses(mesh, 4000, sensor, np.random.default_rng(0)))
    assert (found.exact.free, len(found.exact.transforms)) == (exact.free, len(exact.transforms))
    assert all(holds(found.exact, motion) for motion in exact.turned(TURNS))
    assert all(holds(found.near, motion) for motion in NEAR.get(name, exact).turned(TURNS))
