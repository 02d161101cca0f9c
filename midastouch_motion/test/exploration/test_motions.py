import numpy as np
import pytest
from fake_arms import Scripted, followed, over_an_edge, refusing, seen

from midastouch_common import se3
from midastouch_motion.exploration.acts import Approach, CheckReach, Lift, Slide, Touch
from midastouch_motion.exploration.motions import Motion, Motions
from midastouch_motion.exploration.reach import EVERYWHERE, Reach
from midastouch_motion.exploration.surroundings import Surroundings

STEP = 1.5e-3


def motions_within(reach=EVERYWHERE):
    return Motions(reach, 0.05, held=lambda: False)


@pytest.mark.parametrize("asks", [False, True])
def test_a_slide_over_an_edge_ends_where_it_began(asks):
    arm, motions = Scripted(over_an_edge), motions_within(Reach([-9] * 3, [9] * 3, np.pi, asks=asks))
    arm.follow(motions.touch())
    assert arm.follow(motions.carry_out(Motion(0.0, 0.03), Surroundings(np.eye(4))))
    asked = [CheckReach] if asks else []
    assert [type(act) for act in arm.acts] == [Touch, *asked, Slide, *asked, Lift, Approach, Touch]
    assert motions.touching
    assert motions.path == pytest.approx(0.008)


def test_from_where_the_arm_is_not_to_be_it_comes_back():
    """A slide follows the surface wherever that leads."""
    tilted = se3.exp(np.array([0.02, 0, 0, 0, np.pi / 2, 0]))
    arm = Scripted(lambda act: (True, "", 0.03, True, tilted if isinstance(act, Slide) else np.eye(4)))
    motions = motions_within(Reach([-9] * 3, [9] * 3, np.radians(70)))
    arm.follow(motions.touch())
    arm.follow(motions.carry_out(Motion(0.0, 0.03), Surroundings(np.eye(4))))
    assert [type(act) for act in arm.acts] == [Touch, Slide, Lift, Approach, Touch]


@pytest.mark.parametrize(("degrees", "motions_are"), [(50, (1, 1)), (170, (0, 2))], ids=["slides", "lifts"])
def test_it_visits_the_surface_next_to_a_shown_position(world, degrees, motions_are):
    motions, finger = motions_within(), world.finger
    followed(world, motions.touch())
    place = 0.05 * finger.pose[:3, :3] @ (np.sin(np.radians(degrees)), 0, np.cos(np.radians(degrees)))
    shown = (world.base_from_object @ [*place, 1.0])[:3]
    poses, arrived = followed(world, motions.visit(shown, seen(world)))
    assert poses
    assert arrived
    assert np.linalg.norm(finger.pose[:3, 3] - 0.6 * place) < STEP
    assert (motions.slides, motions.lifts) == motions_are
    assert motions.path == pytest.approx(0.03 * np.radians(50) if motions_are[0] else 0.0, abs=3e-3)
    assert followed(world, motions.visit(shown, seen(world))) == ([], True), "it is there"


def test_to_a_position_a_hair_away_it_slides(world):
    motions, finger = motions_within(), world.finger
    followed(world, motions.touch())
    place = 0.03 * finger.pose[:3, :3] @ (np.sin(0.05), 0, np.cos(0.05))
    shown = (world.base_from_object @ [*place, 1.0])[:3]
    assert followed(world, motions.visit(shown, seen(world)))[1]
    assert (motions.slides, motions.lifts) == (1, 1)


def test_a_position_that_cannot_be_touched_is_told():
    arm, motions = Scripted(refusing), motions_within()
    assert not arm.follow(motions.visit(np.array([0.1, 0, 0]), Surroundings(np.eye(4))))


def test_it_goes_back_to_the_last_place_where_it_can_stay():
    """It has touched above and beside; beside it turns out of reach now."""
    places = {0.0: np.eye(4), 0.05: se3.translation([0.05, 0, 0])}
    out = se3.exp(np.array([0.05, 0, 0, 0, np.pi / 2, 0]))
    here = 0.0

    def script(act):
        nonlocal here
        if isinstance(act, Approach):
            here = float(act.pose[0, 3])
        return True, "", 0.0, isinstance(act, Touch), places[here]

    arm, motions = Scripted(script), motions_within(Reach([-9] * 3, [9] * 3, np.radians(70)))
    arm.follow(motions.touch())
    assert arm.follow(motions.carry_out(Motion(0.0, 0.05, lift=True), Surroundings(np.eye(4))))
    del arm.acts[:]
    assert arm.follow(motions.back())
    assert [act.pose[0, 3] for act in arm.acts if isinstance(act, Approach)] == [0.05]
    del arm.acts[:]
    places[0.05] = out
    assert arm.follow(motions.back())
    assert motions.gel[0, 3] == 0.0
    del arm.acts[:]
    assert arm.follow(motions.back())
    assert [act.pose[0, 3] for act in arm.acts if isinstance(act, Approach)] == [0.0], "the other is forgotten"


def test_unable_to_lift_along_its_axis_it_goes_back_straight():
    """Beside the object, tilted, and at the end of its reach."""
    aside = se3.translation([0.1, 0, 0]) @ se3.exp(np.array([0, 0, 0, 0, 1.2, 0]))
    poses = iter([np.eye(4), aside])

    def script(act):
        if isinstance(act, CheckReach):
            return act.poses[:, 0, 3].max() < 0.1, "too short", 0.0, False, np.eye(4)
        return True, "", 0.03, isinstance(act, Touch), next(poses, np.eye(4))

    arm, motions = Scripted(script), motions_within(Reach([-9] * 3, [9] * 3, np.pi, asks=True))
    arm.follow(motions.touch())
    arm.follow(motions.carry_out(Motion(0.0, 0.03), Surroundings(np.eye(4))))
    del arm.acts[:]
    assert arm.follow(motions.back())
    assert [type(act) for act in arm.acts] == [CheckReach, CheckReach, Approach, Touch]
    assert arm.acts[2].pose == pytest.approx(se3.translation([0, 0, 0.012]))


def test_before_the_first_touch_there_is_no_way_back():
    arm, motions = Scripted(refusing), motions_within()
    assert not arm.follow(motions.back())
    assert arm.acts == []
