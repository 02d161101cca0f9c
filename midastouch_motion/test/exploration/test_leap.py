import numpy as np
import pytest
from fake_arms import Scripted, followed, seen

from midastouch_common import se3
from midastouch_motion.exploration.acts import Approach, Lift, Touch
from midastouch_motion.exploration.leap import CLEARANCES, SEARCHED, leap, ways_along, ways_to
from midastouch_motion.exploration.surroundings import Surroundings

HERE = np.eye(4)
THERE, BEYOND = (se3.translation([x, 0.0, 0.0])[None] for x in (0.05, 0.06))


class Air(Scripted):
    """An arm that moves as it is told, but for what `stops(act)`."""

    def __init__(self, stops=lambda act: False):
        self.pose = HERE
        super().__init__(lambda act: self._answer_to(act, stops(act)))

    def _answer_to(self, act, stopped):
        if isinstance(act, Lift):
            self.pose = self.pose @ se3.translation([0.0, 0.0, act.height])
        if isinstance(act, Approach) and not stopped:
            self.pose = act.pose
        return not stopped, "", 0.01, isinstance(act, Touch) and not stopped, self.pose

    @property
    def kinds(self):
        return [type(act) for act in self.acts]


def test_where_it_cannot_be_lifted_it_touches_on():
    arm = Air(lambda act: isinstance(act, Lift))
    assert not arm.follow(leap([THERE, BEYOND]))
    assert arm.kinds == [Lift, Touch]


def test_where_something_is_in_the_way_it_goes_higher():
    arm = Air(lambda act: isinstance(act, Approach) and act.pose[0, 3] > 0 and act.pose[2, 3] < 0.02)
    assert arm.follow(leap([THERE, BEYOND]))
    assert arm.kinds == [Lift, Approach, Approach, Lift, Approach, Approach, Touch]
    assert arm.acts[3].height == pytest.approx(CLEARANCES[1] - CLEARANCES[0])
    assert arm.acts[4].pose[0, 3] == pytest.approx(THERE[0, 0, 3])
    assert arm.acts[6].distance == pytest.approx(CLEARANCES[1] + SEARCHED), "from where it came to on the way down"


def test_from_high_up_it_comes_down_in_the_air_before_it_touches():
    barred = iter([False, True])
    arm = Air(lambda act: isinstance(act, Approach) and next(barred, False))
    assert arm.follow(leap([np.concatenate([THERE, BEYOND])]))
    assert arm.kinds == [Lift, *[Approach] * 4, Lift, *[Approach] * 3, Touch]
    np.testing.assert_allclose(arm.acts[8].pose, BEYOND[0] @ se3.translation([0.0, 0.0, CLEARANCES[0]]))
    assert arm.acts[9].distance == pytest.approx(CLEARANCES[0] + SEARCHED)


def test_a_way_without_a_touch_is_retraced_and_the_next_tried():
    arm = Air(lambda act: isinstance(act, Touch) and arm.pose[0, 3] < 0.055)
    assert arm.follow(leap([THERE, BEYOND]))
    assert arm.kinds == [Lift, Approach, Touch, Approach, Approach, Approach, Touch]
    np.testing.assert_allclose(arm.acts[4].pose, HERE @ se3.translation([0.0, 0.0, CLEARANCES[0]]))


def test_if_nothing_can_be_touched_it_comes_down_where_it_was():
    arm = Air(lambda act: isinstance(act, Touch) and arm.pose[0, 3] > 0)
    assert not arm.follow(leap([THERE, BEYOND]))
    np.testing.assert_allclose(arm.pose, HERE @ se3.translation([0.0, 0.0, CLEARANCES[0]]))
    assert arm.kinds[-1] is Touch


def test_where_the_way_back_is_barred_it_stays_in_the_air():
    """Nobody has asked whether it may go down there."""
    arm = Air(lambda act: isinstance(act, Touch) or (isinstance(act, Approach) and act.pose[0, 3] == 0))
    assert not arm.follow(leap([THERE, BEYOND]))
    assert arm.kinds == [Lift, Approach, Touch, Approach, Approach]
    assert arm.pose[0, 3] == pytest.approx(THERE[0, 0, 3])


def test_around_an_object_it_goes_from_pose_to_pose(world):
    around = seen(world)
    way = ways_along(around, 0.0, 0.03 * np.pi)[0]
    turns = np.degrees(se3.rotation_angle(np.swapaxes(way[:-1, :3, :3], 1, 2) @ way[1:, :3, :3]))
    assert len(way) == 4
    assert turns.max() < 61
    before = world.finger.pose
    assert followed(world, leap(ways_along(around, 0.0, 0.03 * np.pi)))[1]
    assert world.finger.pose[:3, 2] @ before[:3, 2] < -0.9


def test_without_a_surface_nearer_positions_follow_the_wanted():
    ways = ways_along(Surroundings(HERE), 0.0, 0.04)
    assert [way[-1][0, 3] for way in ways] == pytest.approx([0.04, 0.02, 0.012], abs=5e-3)


def test_next_to_a_position_others_are_on_the_way_back_from_it(world):
    around = seen(world)
    goal = around.over((world.base_from_object @ [0.03, 0, 0, 1])[:3])[:3, 3]
    ways = ways_to(around, goal)
    far = [np.linalg.norm(way[-1][:3, 3] - around.gel[:3, 3]) for way in ways]
    assert len(ways) == 3
    assert far == sorted(far, reverse=True)
