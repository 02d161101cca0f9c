import numpy as np
import pytest
from fake_arms import followed

from midastouch_common import se3
from midastouch_motion.exploration.acts import Approach, Lift, Slide, Touch
from midastouch_simulation.world import PUSH


def asked(world, act):
    """How an act ended."""

    def once():
        return (yield act)

    return followed(world, once())[1]


def test_each_act_says_how_it_ended(world):
    touch = asked(world, Touch(0.05))
    assert (touch.success, touch.touching, touch.message) == (True, True, "touches")
    np.testing.assert_allclose(touch.pose, world.base_from_gel)
    slide = asked(world, Slide(0.0, 0.03))
    assert slide.success
    assert slide.message.startswith("slid")
    assert slide.path == pytest.approx(0.03, abs=1e-3)
    lift = asked(world, Lift(0.02))
    assert (lift.success, lift.touching, lift.message) == (True, False, "lifted by 20 mm")
    goal = world.base_from_gel @ se3.exp(np.array([0.02, 0, 0.01, 0.2, 0, 0]))
    approach = asked(world, Approach(goal))
    assert approach.success
    np.testing.assert_allclose(approach.pose, goal, atol=1e-9)


def test_each_act_says_why_it_came_to_nothing(world):
    assert asked(world, Slide(0.0, 0.03)).message == "it could not go on after 0 mm"
    up = asked(world, Touch(0.03, (0.0, 0.0, 1.0)))
    assert up.message == "nothing on which it fits touched within 30 mm"
    through = world.base_from_gel.copy()
    through[:3, 3] = 2 * world.base_from_object[:3, 3] - through[:3, 3]
    ended = asked(world, Approach(through))
    assert not ended.success
    assert ended.message.startswith("touched on the way after")


def test_a_push_moves_the_object_and_not_the_finger(world):
    asked(world, Touch(0.05))
    before, gel = world.base_from_object, world.base_from_gel
    on_object = world.finger.pose
    assert list(world.push())
    moved = se3.inverse(before) @ world.base_from_object
    assert np.degrees(se3.rotation_angle(moved[:3, :3])) == pytest.approx(np.degrees(PUSH[1]), abs=0.1)
    assert np.linalg.norm(world.base_from_gel[:3, 3] - gel[:3, 3]) < 1e-3
    shift = np.linalg.norm(world.finger.pose[:3, 3] - on_object[:3, 3])
    assert shift == pytest.approx(PUSH[0], rel=0.3)
    assert world.finger.touching


def test_a_push_leaves_a_finger_in_the_air_where_it_is(world):
    gel = world.base_from_gel
    list(world.push())
    np.testing.assert_allclose(world.base_from_gel, gel, atol=1e-9)
