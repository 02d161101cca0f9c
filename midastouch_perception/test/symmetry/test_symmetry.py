import json

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_common.pose_metric import ROTATION_SCALE
from midastouch_perception.codebook import codebook_poses
from midastouch_perception.objects import bundled_objects
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.symmetry.bop import symmetry_of_bop
from midastouch_perception.symmetry.group import Symmetry
from midastouch_perception.symmetry.search import DETECTABLE, ObjectSymmetry, object_symmetry
from midastouch_simulation.procedural import difference, mesh_from_sdf
from midastouch_simulation.solids import Layer, circle, rectangle, stacked

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


def measured_symmetry(mesh: ObjectMesh, **given) -> ObjectSymmetry:
    """What a DIGIT feels of a symmetry."""
    sensor = SensorModel.load("digit_tacto")
    return object_symmetry(mesh, sensor, codebook_poses(mesh, 2000, sensor, np.random.default_rng(0)), **given)


def turn(*rotvec: float) -> np.ndarray:
    return se3.make(Rotation.from_rotvec(rotvec).as_matrix(), np.zeros(3))


@pytest.mark.slow
def test_a_box_has_four_symmetries_a_ball_all():
    found = measured_symmetry(moved_mesh(trimesh.creation.box((0.08, 0.05, 0.03)))).near
    assert (found.free, len(found.transforms)) == ("none", 4)
    assert contains(found, turn(np.pi, 0, 0))
    assert contains(found, turn(0, np.pi, 0))
    assert not contains(found, turn(0, 0, np.pi / 2))

    assert measured_symmetry(ObjectMesh.load(bundled_objects()["ball"])).near.free == "all"


@pytest.mark.slow
def test_the_handle_tool_has_none(tool):
    found = measured_symmetry(tool).near
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
    np.testing.assert_array_equal(found.nearest(poses, np.full((4, 4), np.nan)), poses)  # without a truth none is


def gear(teeth: int, missing: int = 0) -> ObjectMesh:
    """A toothed wheel of 100 mm, its first teeth missing, away from the origin."""
    angle = np.arange(4 * teeth) * 2 * np.pi / (4 * teeth)
    radius = np.where(np.arange(4 * teeth) % 4 < 2, 0.05, 0.044)
    radius[: 4 * missing] = 0.044
    ring = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    vertices = np.concatenate([np.column_stack([ring, np.full(len(ring), z)]) for z in (0.0, 0.02)])
    vertices = np.concatenate([vertices, [[0, 0, 0], [0, 0, 0.02]]])
    here = np.arange(len(ring))
    after, up = np.roll(here, -1), len(ring)
    faces = [(here, after, after + up), (here, after + up, here + up), (after, here, 0 * here + 2 * up),
             (here + up, after + up, 0 * here + 2 * up + 1)]  # fmt: skip
    return moved_mesh(trimesh.Trimesh(vertices, np.concatenate([np.stack(each, axis=1) for each in faces])))


def test_every_tooth_of_a_gear_is_like_every_other():
    found = measured_symmetry(gear(20))
    assert (found.exact.free, len(found.exact.transforms)) == ("none", 40)
    assert contains(found.exact, turn(0, 0, np.radians(18)))
    assert not contains(found.exact, turn(0, 0, np.radians(9)))
    assert found.residual < DETECTABLE
    assert not len(found.look_alikes)


@pytest.fixture(scope="module")
def without_a_tooth() -> ObjectSymmetry:
    return measured_symmetry(gear(12, missing=1))


def test_a_missing_tooth_is_measured_and_leaves_look_alikes(without_a_tooth):
    found = without_a_tooth
    assert len(found.exact.transforms) == 2  # it can still be turned over
    assert len(found.look_alikes) == 11
    images = found.look_alikes @ MOVED
    wanted = MOVED @ turn(0, 0, np.radians(150))
    assert found.exact.distance(images, wanted).min() < 1e-3


@pytest.mark.slow
def test_many_flats_count_as_round_and_six_sides_do_not():
    round_, hexagon = (measured_symmetry(moved_mesh(trimesh.creation.cylinder(0.03, 0.1, sections=n))) for n in (32, 6))
    assert round_.exact.describe() == "axis, both ends alike"
    assert 0 < round_.residual < 5e-4
    assert len(hexagon.exact.transforms) == 12


def nut() -> ObjectMesh:
    """M4, whose thread only one half turn maps onto itself."""
    apart = np.array([[np.cos(a), np.sin(a)] for a in np.radians([0, 60, 120])])

    def hexagon(p: np.ndarray) -> np.ndarray:
        return np.maximum(np.abs(p[:, :2] @ apart.T).max(axis=1) - 3.5e-3, np.abs(p[:, 2]) - 1.6e-3)

    def thread(p: np.ndarray) -> np.ndarray:
        turns = p[:, 2] / 7e-4 - np.arctan2(p[:, 1], p[:, 0]) / (2 * np.pi)
        return np.hypot(p[:, 0], p[:, 1]) - 1.81e-3 - 1.9e-4 * np.cos(2 * np.pi * turns)

    shape = mesh_from_sdf(difference(hexagon, thread), np.array([4.5e-3, 4.5e-3, 2.1e-3]), 1.6e-4, "nut")
    return moved_mesh(trimesh.Trimesh(shape.vertices, shape.faces, process=False))


@pytest.mark.slow
def test_a_thread_out_of_reach_leaves_a_nut_its_half_turns():
    found = measured_symmetry(nut())
    assert len(found.exact.transforms) == 12
    for angle in np.radians(30 * np.arange(6)):
        assert contains(found.exact, turn(np.pi * np.cos(angle), np.pi * np.sin(angle), 0))
    assert found.residual < DETECTABLE


def brick(chamfer: float) -> ObjectMesh:
    """Two by four studs; one corner of its top cut."""
    body = rectangle(0.032, 0.016)
    cut = np.array([[0.016 - chamfer, 0.0081], [0.0161, 0.008 - chamfer], [0.0161, 0.0081]])
    studs = tuple(circle(0.0024, x, y, sides=32) for x in (-0.012, -0.004, 0.004, 0.012) for y in (-0.004, 0.004))
    mesh = stacked([Layer(0.0056, (body,)), Layer(0.004, (body,), (cut,)), Layer(0.0018, studs)], "brick")
    return moved_mesh(trimesh.Trimesh(mesh.vertices, mesh.faces, process=False))


@pytest.mark.parametrize(("chamfer", "same"), [(1e-4, True), (2.5e-3, False)])
def test_a_brick_has_its_half_turn_unless_a_corner_is_cut(chamfer, same):
    assert contains(measured_symmetry(brick(chamfer)).exact, turn(0, 0, np.pi)) == same


def test_what_the_user_says_is_not_looked_for_and_kept():
    half_turn = Symmetry(np.array([np.eye(4), MOVED @ turn(0, 0, np.pi) @ se3.inverse(MOVED)]))
    found = measured_symmetry(gear(12, missing=1), given=half_turn)
    assert found.given
    assert len(found.exact.transforms) == 2
    assert found.residual > DETECTABLE  # as is said
    assert ObjectSymmetry.from_json(found.as_json() | {"search": 1}).given, "it outlives an older search"


def test_it_survives_a_file(without_a_tooth):
    found = without_a_tooth
    again = ObjectSymmetry.from_json(json.loads(json.dumps(found.as_json())))
    np.testing.assert_array_equal(again.exact.transforms, found.exact.transforms)
    np.testing.assert_array_equal(again.look_alikes, found.look_alikes)
    assert again.describe() == found.describe()
    assert ObjectSymmetry.from_json(found.as_json() | {"search": 1}) is None, "an older search"


BOP = {
    "1": {"diameter": 100.0, "symmetries_discrete": [[-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 5, 0, 0, 0, 1]]},
    "2": {"symmetries_continuous": [{"axis": [0, 0, 2], "offset": [10, 0, 0]}]},
    "3": {},
    "4": {
        "symmetries_continuous": [{"axis": [0, 0, 1], "offset": [0, 0, 0]}, {"axis": [1, 0, 0], "offset": [9, 0, 0]}]
    },
}


def test_a_symmetry_is_read_from_bop(tmp_path):
    path = tmp_path / "models_info.json"
    path.write_text(json.dumps(BOP))
    discrete = symmetry_of_bop(f"{path}:1")
    assert discrete.transforms[1, :3, 3] == pytest.approx([0, 0, 0.005])
    axis = symmetry_of_bop(f"{path}:2")
    assert (axis.free, axis.axis.tolist(), axis.centre.tolist()) == ("axis", [0, 0, 1], [0.01, 0, 0])
    assert symmetry_of_bop(f"{path}:3").trivial
    assert symmetry_of_bop(f"{path}:4").free == "all"
    with pytest.raises(InputError, match="no object 9"):
        symmetry_of_bop(f"{path}:9")
    path.write_text(json.dumps({"7": BOP["1"]}))
    assert len(symmetry_of_bop(str(path)).transforms) == 2


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("{", "not a JSON file"),
        ("[]", "not a table of objects"),
        (json.dumps(BOP), "say which one"),
        (json.dumps({"1": {"symmetries_discrete": [[1, 2]]}}), "16 numbers"),
        (json.dumps({"1": {"symmetries_discrete": [[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 0, 0, 1]]}}), "row by row"),
        (json.dumps({"1": {"symmetries_discrete": [np.diag([1, 1, -1, 1]).ravel().tolist()]}}), "rigid"),
        (json.dumps({"1": {"symmetries_continuous": [{"axis": [0, 0, 0], "offset": [0, 0, 0]}]}}), "no direction"),
        (json.dumps({"1": {"symmetries_continuous": [{"axis": [0, 0, 1]}]}}), "offset"),
        (
            json.dumps({"1": {"symmetries_continuous": [
                {"axis": [0, 0, 1], "offset": [0, 0, 0]}, {"axis": [1, 0, 0], "offset": [0, 50, 0]}
            ]}}), "do not meet"
        ),
    ],
)  # fmt: skip
def test_what_bop_does_not_allow_is_refused(tmp_path, content, said):
    path = tmp_path / "models_info.json"
    path.write_text(content)
    with pytest.raises(InputError, match=said) as error:
        symmetry_of_bop(str(path))
    assert "models_info.json" in str(error.value)
