import json

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_common.pose_metric import ROTATION_SCALE
from midastouch_perception.objects import bundled_objects
from midastouch_perception.symmetry import search
from midastouch_perception.symmetry.group import Symmetry
from midastouch_perception.symmetry.search import cached_symmetry, find_symmetry

MOVED = se3.exp(np.array([0.1, -0.05, 0.02, 0.7, -0.4, 1.1]))
AXIS = Symmetry(
    np.array([np.eye(4), se3.make(Rotation.from_rotvec([np.pi, 0, 0]).as_matrix(), [0, 0, 0.02])]),
    "axis",
    np.array([0.0, 0, 1]),
    np.array([0.0, 0, 0.01]),
)


def moved_mesh(shape: trimesh.Trimesh) -> ObjectMesh:
    """A shape away from the origin and turned, as scans are."""
    shape = shape.copy().apply_transform(MOVED)
    return ObjectMesh.from_arrays(shape.vertices, shape.faces, "shape")


def contains(found: Symmetry, motion: np.ndarray) -> bool:
    """Whether a motion given in the shape's own frame is one of the symmetries."""
    wanted = MOVED @ motion @ se3.inverse(MOVED)
    poses = wanted @ MOVED @ se3.exp(np.array([[0.03, 0.01, 0, 0.3, 0, 0]]))
    truth = MOVED @ se3.exp(np.array([0.03, 0.01, 0, 0.3, 0, 0]))
    nearest = found.nearest(poses, truth)[0]
    distance = np.linalg.norm(nearest[:3, 3] - truth[:3, 3])
    return distance < 1e-3 and se3.rotation_angle(nearest[:3, :3].T @ truth[:3, :3]) < np.radians(2)


def turn(*rotvec: float) -> np.ndarray:
    return se3.make(Rotation.from_rotvec(rotvec).as_matrix(), np.zeros(3))


def test_a_box_has_four_symmetries_and_no_mirrored_one():
    found = find_symmetry(moved_mesh(trimesh.creation.box((0.08, 0.05, 0.03))))
    assert (found.free, len(found.transforms)) == ("none", 4)
    assert contains(found, turn(np.pi, 0, 0))
    assert contains(found, turn(0, np.pi, 0))
    assert not contains(found, turn(0, 0, np.pi / 2))


@pytest.mark.slow
def test_a_cylinder_turns_about_its_axis_and_can_stand_on_its_head():
    found = find_symmetry(moved_mesh(trimesh.creation.cylinder(0.03, 0.1, sections=64)))
    assert found.describe() == "axis, both ends alike"
    assert abs(found.axis @ MOVED[:3, 2]) == pytest.approx(1, abs=1e-3)
    assert contains(found, turn(0, 0, 1.234))
    assert contains(found, turn(np.pi, 0, 0) @ turn(0, 0, 0.5))
    assert not contains(found, turn(1.0, 0, 0))


def test_a_ball_is_the_same_from_everywhere():
    found = find_symmetry(ObjectMesh.load(bundled_objects()["ball"]))
    assert found.free == "all"


@pytest.mark.slow
def test_the_handle_tool_has_none():
    found = find_symmetry(ObjectMesh.load(bundled_objects()["handle_tool"]))
    assert found.trivial
    poses = MOVED @ se3.exp(np.zeros((3, 6)))
    assert (found.nearest(poses, np.eye(4)) == poses).all()


@pytest.mark.parametrize("free", ["axis", "all"])
def test_the_nearest_equivalent_is_nearest_over_all_turns(free):
    rng = np.random.default_rng(0)
    found = Symmetry(AXIS.transforms, free, AXIS.axis, AXIS.centre)
    poses = se3.make(se3.random_rotations(20, rng), rng.normal(0, 0.03, (20, 3)))
    truth = se3.make(se3.random_rotations(1, rng)[0], rng.normal(0, 0.03, 3))
    if free == "axis":
        turns = Rotation.from_rotvec(np.linspace(0, 2 * np.pi, 721)[:, None] * AXIS.axis).as_matrix()
    else:
        turns = se3.random_rotations(20_000, rng)
    turns = se3.make(turns, AXIS.centre - turns @ AXIS.centre)

    def squared(candidates: np.ndarray) -> np.ndarray:
        angle = se3.rotation_angle(np.swapaxes(candidates[..., :3, :3], -1, -2) @ truth[:3, :3])
        distance = np.square(candidates[..., :3, 3] - truth[:3, 3]).sum(axis=-1)
        return distance + np.square(2 * ROTATION_SCALE * np.sin(angle / 2))

    for pose, nearest in zip(poses, found.nearest(poses, truth), strict=True):
        best = min(squared(turns @ transform @ pose).min() for transform in AXIS.transforms)
        assert squared(nearest) <= best + 1e-12
        assert squared(nearest) == pytest.approx(best, abs=3e-5)


@pytest.mark.parametrize("free", ["axis", "all"])
def test_without_a_truth_none_is_nearer(free):
    symmetry, pose = Symmetry(np.eye(4)[None], free, np.zeros(3), np.array([0.0, 0, 1])), np.eye(4)[None]
    np.testing.assert_array_equal(symmetry.nearest(pose, np.full((4, 4), np.nan)), pose)


def test_an_equivalent_pose_has_no_error():
    truth = MOVED
    turned = se3.make(Rotation.from_rotvec(2.0 * AXIS.axis).as_matrix(), np.zeros(3))
    about = se3.make(np.eye(3), AXIS.centre) @ turned @ se3.make(np.eye(3), -AXIS.centre)
    assert AXIS.nearest((about @ AXIS.transforms[1] @ truth)[None], truth)[0] == pytest.approx(truth, abs=1e-9)


def test_it_is_found_once_per_mesh(tmp_path, monkeypatch):
    mesh = ObjectMesh.load(bundled_objects()["ball"])
    first = cached_symmetry(mesh, tmp_path)
    monkeypatch.setattr(search, "find_symmetry", lambda mesh: pytest.fail("found again"))
    again = cached_symmetry(mesh, tmp_path)
    assert (again.free, again.describe()) == (first.free, first.describe())
    assert again.centre == pytest.approx(first.centre)


def test_what_is_not_a_symmetry_file_is_refused(tmp_path):
    path = tmp_path / "s.json"
    path.write_text(json.dumps({"transforms": "none"}))
    with pytest.raises(InputError, match="not a symmetry file"):
        Symmetry.load(path)
