import numpy as np
import pytest

from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh
from midastouch_motion.exploration.surroundings import Surroundings
from midastouch_perception.objects import bundled_objects

RADIUS = 0.03  # m, of the ball
OBJECT = se3.exp(np.array([0.4, -0.1, 0.2, 0.1, 0.2, 0.3]))  # T_base_obj
TOP = se3.translation([0.0, 0.0, RADIUS])  # T_obj_gel


@pytest.fixture(scope="module")
def ball():
    return ObjectMesh.load(bundled_objects()["ball"])


def test_on_a_known_surface_a_way_stays_on_it_and_turns_with_it(ball):
    track = Surroundings(OBJECT @ TOP, OBJECT, ball).track(0.0, RADIUS * np.pi / 2)
    on_object = se3.inverse(OBJECT) @ track.poses
    np.testing.assert_allclose(np.linalg.norm(on_object[:, :3, 3], axis=1), RADIUS, atol=2e-4)
    np.testing.assert_allclose(on_object[-1, :3, 3], [RADIUS, 0, 0], atol=1.5e-3)
    np.testing.assert_allclose(on_object[-1, :3, 2], [1, 0, 0], atol=0.05)
    np.testing.assert_allclose(track.poses[0], OBJECT @ TOP, atol=5e-3)


def test_with_no_surface_a_way_is_straight_in_the_gel_s_plane():
    track = Surroundings(OBJECT).track(np.pi / 2, 0.03)
    np.testing.assert_allclose((se3.inverse(OBJECT) @ track.poses)[-1], se3.translation([0, 0.03, 0]), atol=1e-12)
    np.testing.assert_allclose(track.gone, np.linalg.norm(track.poses[:, :3, 3] - OBJECT[:3, 3], axis=1), atol=1e-12)


def test_the_pose_so_far_along_a_way():
    track = Surroundings(np.eye(4)).track(0.0, 0.03)
    assert track.at(0.0)[0, 3] == 0
    assert track.at(0.01)[0, 3] == pytest.approx(0.012)  # the next one
    assert track.at(1.0)[0, 3] == pytest.approx(0.03)


def test_a_gel_over_a_position_is_flat_on_the_surface_next_to_it(ball):
    around = Surroundings(OBJECT @ TOP, OBJECT, ball)
    beside = (OBJECT @ [0.05, 0, 0, 1])[:3]
    np.testing.assert_allclose(se3.inverse(OBJECT) @ around.over(beside), [
        [0, 0, 1, RADIUS], [0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 0, 1],
    ], atol=0.03)  # fmt: skip
    unknown = Surroundings(OBJECT)
    np.testing.assert_allclose(unknown.over(beside), se3.make(OBJECT[:3, :3], beside))


def test_a_way_towards_a_position_begins_in_its_direction(ball):
    goal = (OBJECT @ [0, RADIUS, 0, 1])[:3]
    track = Surroundings(OBJECT @ TOP, OBJECT, ball).towards(goal, 0.02)
    assert track.heading == pytest.approx(np.pi / 2, abs=0.05)
