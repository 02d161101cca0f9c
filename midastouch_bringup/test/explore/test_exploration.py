import types

import numpy as np
import pytest

from midastouch_bringup.explore.exploration import PUSH, Exploration, Motion, World
from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh
from midastouch_perception.objects import bundled_objects
from midastouch_perception.sensor_model import SensorModel

STEP = 1.5e-3


@pytest.fixture
def world():
    """A finger over the ball."""
    mesh, sensor = ObjectMesh.load(bundled_objects()["ball"]), SensorModel.load("digit_tacto")
    return World(mesh, sensor, np.random.default_rng(3), STEP)


@pytest.fixture
def exploration(world):
    """One that has touched, with half a metre to go."""
    exploration = Exploration(world, np.random.default_rng(4), max_path=0.5)
    list(exploration.touch())
    return exploration


class NailedFinger:
    """It goes nowhere."""

    touching = True
    pose = np.eye(4)

    def slide(self, heading, length):
        return iter(())

    leap = slide

    def slide_to(self, goal):
        return iter(())

    leap_to = slide_to

    def touches(self, goal):
        return False


@pytest.fixture
def stuck():
    mesh = types.SimpleNamespace(name="wall", diagonal=0.1, closest_points=lambda points: (points, None, None))
    return Exploration(types.SimpleNamespace(finger=NailedFinger(), mesh=mesh), np.random.default_rng(0), 1.0)


def test_it_does_what_is_suggested_first(exploration):
    poses = list(exploration.go([Motion(0.0, 0.03), Motion(1.0, 0.03, lift=True)]))
    assert len(poses) == 20
    assert exploration.path == pytest.approx(0.03, abs=3e-3)
    assert (exploration.slides, exploration.lifts) == (1, 1)  # the lift is the first touch


def test_where_a_slide_was_blocked_it_lifts_first(exploration, monkeypatch):
    finger = exploration.world.finger
    blocked = lambda heading, length: iter([finger.pose])  # noqa: E731  # one image, no way
    with monkeypatch.context() as patched:
        patched.setattr(finger, "slide", blocked)
        list(exploration.go([Motion(0.0, 0.03)]))
    for motions_are in ((1, 2), (2, 2)):  # the slide comes first again after that
        list(exploration.go([Motion(0.0, 0.03), Motion(1.0, 0.03, lift=True)]))
        assert (exploration.slides, exploration.lifts) == motions_are


@pytest.mark.parametrize(("degrees", "motions_are"), [(50, (1, 1)), (170, (0, 2))], ids=["slides", "lifts"])
def test_it_visits_the_surface_next_to_a_place_that_a_person_shows(exploration, degrees, motions_are):
    finger = exploration.world.finger
    place = 0.05 * finger.pose[:3, :3] @ (np.sin(np.radians(degrees)), 0, np.cos(np.radians(degrees)))
    arrived = []
    assert list(visit(exploration, place, arrived))
    assert arrived == [True]
    assert np.linalg.norm(finger.pose[:3, 3] - 0.6 * place) < STEP
    assert (exploration.slides, exploration.lifts) == motions_are
    assert exploration.path == pytest.approx(0.03 * np.radians(50) if motions_are[0] else 0.0, abs=3e-3)
    assert not list(visit(exploration, place, arrived))  # it is there
    assert arrived == [True, True]


def test_a_place_that_cannot_be_touched_is_told(stuck):
    arrived = []
    assert not list(visit(stuck, np.zeros(3), arrived))
    assert arrived == [False]
    assert stuck.verdict is None  # a person's wish ends nothing


def visit(exploration, place, arrived):
    arrived.append((yield from exploration.visit(place)))


def test_without_a_suggestion_it_goes_somewhere(exploration):
    assert list(exploration.go([]))
    assert exploration.verdict is None


def test_it_knows_once_the_filter_is_sure_after_two_motions(exploration):
    for state in ("converged", "ambiguous", "converged"):
        exploration.judge(state, "", measured=True)
        assert exploration.verdict is None
    exploration.judge("converged", "one mode is left, modulo symmetry: 6 poses alike", measured=True)
    assert exploration.verdict.known
    assert "modulo symmetry: 6 poses alike" in exploration.verdict.words


@pytest.mark.parametrize(
    ("happens", "words"),
    [
        (lambda it: it.judge("no_contact", "", measured=False), "measured nothing for 3 motions"),
        (lambda it: it.refused("not in contact"), "no suggestion where to touch next: not in contact"),
        (lambda it: it.hopeless("(1, 2, 3) mm"), "nothing tells the poses apart: (1, 2, 3) mm"),
    ],
    ids=["unfelt", "refused", "hopeless"],
)
def test_it_gives_up_after_the_third_time_in_a_row(exploration, happens, words):
    for _ in range(2):
        happens(exploration)
        assert exploration.verdict is None
    happens(exploration)
    assert not exploration.verdict.known
    assert words in exploration.verdict.words


def test_what_goes_well_in_between_starts_the_count_anew(exploration):
    for _ in range(3):
        exploration.refused("why")
        exploration.hopeless("why")
        exploration.judge("no_contact", "", measured=False)
        exploration.judge("ambiguous", "", measured=True)
        exploration.accepted()
    assert exploration.verdict is None


def test_without_suggestions_that_help_it_looks_for_others_elsewhere(exploration):
    assert all(motion.lift for motion in exploration.hopeless("why"))


def test_it_gives_up_after_the_longest_way(exploration):
    while exploration.path <= 0.5:
        assert list(exploration.go([Motion(0.3, 0.1)]))
    exploration.judge("lost", "these touches are not of this mesh", measured=True)
    assert exploration.verdict.words.startswith("still lost after 0.5")
    assert exploration.verdict.words.endswith("these touches are not of this mesh")


def test_a_finger_that_cannot_move_or_touch_is_no_loop(stuck):
    assert list(stuck.go([Motion(0.0, 0.1)])) == []
    assert "stuck" in stuck.verdict.words
    assert "wall" in stuck.verdict.words
    stuck.restart()
    assert list(stuck.touch()) == []
    assert stuck.verdict.words == "the finger does not reach wall below it"


def test_another_object_begins_anew(exploration):
    list(exploration.go([]))
    exploration.judge("converged", "", measured=True)
    exploration.restart()
    exploration.judge("converged", "", measured=True)
    assert (exploration.path, exploration.slides, exploration.lifts) == (0.0, 0, 0)
    assert exploration.verdict is None


def test_a_push_moves_the_object_and_not_the_finger(world):
    exploration = Exploration(world, np.random.default_rng(4), max_path=0.5)
    list(exploration.touch())
    before, gel = world.base_from_object, world.base_from_gel
    on_object = world.finger.pose
    assert list(world.push())
    moved = se3.inverse(before) @ world.base_from_object
    assert np.degrees(se3.rotation_angle(moved[:3, :3])) == pytest.approx(np.degrees(PUSH[1]), abs=0.1)
    assert np.linalg.norm(world.base_from_gel[:3, 3] - gel[:3, 3]) < 1e-3
    shift = np.linalg.norm(world.finger.pose[:3, 3] - on_object[:3, 3])
    assert shift == pytest.approx(PUSH[0], rel=0.3)
    assert world.finger.touching
