import numpy as np
import pytest
from fake_arms import Scripted, followed, refusing, seen

from midastouch_common import se3
from midastouch_filter.active_touch.suggestion import Advice, Suggestion
from midastouch_motion.exploration.acts import Approach, CheckReach, Lift, Slide, Touch
from midastouch_motion.exploration.exploration import Exploration
from midastouch_motion.exploration.motions import Motion
from midastouch_motion.exploration.reach import Reach
from midastouch_motion.exploration.surroundings import Surroundings

STEP = 1.5e-3


@pytest.fixture
def exploration(world):
    """One that has touched, with half a metre to go."""
    exploration = Exploration(np.random.default_rng(4), max_path=0.5)
    followed(world, exploration.touch())
    return exploration


def advice(*suggestions, indistinguishable=False, message=""):
    """Each suggestion: heading, length, lift, information."""
    nowhere = np.zeros((0, 4, 4))
    made = [Suggestion(h, n, lift, nats, n, f"worth {nats}", nowhere) for h, n, lift, nats in suggestions]
    return Advice(made, indistinguishable, message)


def touched(answer, cone=np.pi, asks=False):
    """An arm that answers so, and an exploration that has touched with it; cone and asks, of its reach."""
    reach = Reach([-9] * 3, [9] * 3, cone, asks)
    arm, exploration = Scripted(answer), Exploration(np.random.default_rng(0), 1.0, reach)
    arm.follow(exploration.touch())
    return arm, exploration


def go(world, exploration, *motions):
    return followed(world, exploration.go(motions, seen(world)))[0]


def test_it_does_what_is_suggested_first(world, exploration):
    poses = go(world, exploration, Motion(0.0, 0.03), Motion(1.0, 0.03, lift=True))
    assert len(poses) == 20
    assert exploration.motions.path == pytest.approx(0.03, abs=3e-3)
    assert (exploration.motions.slides, exploration.motions.lifts) == (1, 1)  # the lift is the first touch


def test_what_tells_most_comes_first_and_says_why(world, exploration):
    around = seen(world)
    reason, plan = exploration.decide(advice((1.0, 0.005, False, 0.1), (0.0, 0.03, False, 0.3)), around)
    assert reason == "worth 0.3"
    assert len(followed(world, plan)[0]) == 20


@pytest.mark.parametrize("known", [True, False])
def test_a_leap_leaves_the_surface_and_touches_elsewhere(world, exploration, known):
    before = world.finger.pose
    went = followed(world, exploration.motions.carry_out(Motion(0.5, 0.03, lift=True), seen(world, known)))[1]
    assert went
    assert exploration.motions.touching
    assert exploration.motions.lifts == 2
    assert exploration.motions.path == 0
    assert 0.015 < np.linalg.norm(world.finger.pose[:3, 3] - before[:3, 3]) < 0.07


def test_where_a_slide_was_blocked_it_lifts_first(world, exploration):
    arm = Scripted(lambda act: (False, "blocked", 1e-3, True, np.eye(4)))
    arm.follow(exploration.motions.carry_out(Motion(0.0, 0.03), Surroundings(np.eye(4))))
    for lifts in (2, 2):  # the slide comes first again after that
        told = advice((0.0, 0.03, False, 0.9), (1.0, 0.03, True, 0.3))
        reason, plan = exploration.decide(told, seen(world))
        followed(world, plan)
        assert exploration.motions.lifts == lifts
        assert reason == ("worth 0.3" if exploration.motions.slides == 1 else "worth 0.9")


def test_it_goes_straight_if_no_way_over_the_surface_is_in_reach(world):
    """The ball is believed to be beside the gel, whose ways over it lean to the side."""
    arm, exploration = touched(lambda act: (True, "", 0.03, True, np.eye(4)), cone=np.radians(50))
    beside = Surroundings(np.eye(4), se3.translation([-0.03, 0, 0]), world.mesh)
    arm.follow(exploration.go([Motion(0.0, 0.03)], beside))
    assert len(arm.acts) > 1
    assert exploration.verdict is None


@pytest.mark.parametrize("refused", [False, True])
def test_it_slides_after_a_vain_leap_and_leaps_after_a_refusal(world, refused):
    """The former says that the believed surface is not there, the latter nothing of it."""
    touches, answers = iter([True, False, True, True]), iter([False, True, True, True])

    def script(act):
        if isinstance(act, CheckReach):
            return next(answers), "joint 3", 0.0, True, np.eye(4)
        return True, "", 0.03, next(touches) if isinstance(act, Touch) else isinstance(act, Slide), np.eye(4)

    arm, exploration = touched(script, asks=refused)
    on_top = Surroundings(np.eye(4), se3.translation([0, 0, -world.mesh.bounds[1, 2]]), world.mesh)
    arm.follow(exploration.go([Motion(0.0, 0.01, True), Motion(1.0, 0.01, True), Motion(0.0, 0.01)], on_top))
    done = [type(act) for act in arm.acts[1:]]
    if refused:
        assert done[:3] == [CheckReach, CheckReach, Lift]
    else:
        assert done == [Lift, Approach, Touch, Approach, Approach, Touch, Slide]


def test_while_the_filter_is_searching_slides_come_before_leaps():
    """A leap goes to where the surface is believed to be."""
    arm, exploration = touched(lambda act: (True, "", 0.03, True, np.eye(4)))

    def first(told, state):
        del arm.acts[:]
        reason, plan = exploration.decide(told, Surroundings(np.eye(4)), state)
        arm.follow(plan)
        return type(arm.acts[0]), reason

    told = advice((0.0, 0.03, True, 0.9), (0.0, 0.03, False, 0.5))
    assert first(told, "ambiguous") == (Lift, "worth 0.9")
    assert first(told, "searching") == (Slide, "worth 0.5")
    at_random = [first(None, "searching")[0] for _ in range(20)]
    assert at_random == [Slide] * 20
    assert Lift in [first(None, "ambiguous")[0] for _ in range(20)]


@pytest.mark.parametrize("searching", [False, True])
def test_off_an_unknown_surface_it_goes_back_to_it(world, searching):
    arm, exploration = touched(lambda act: (True, "", 0.0, isinstance(act, Touch), np.eye(4)))
    exploration.motions.touching = False
    del arm.acts[:]
    if searching:
        on_top = Surroundings(np.eye(4), se3.translation([0, 0, -world.mesh.bounds[1, 2]]), world.mesh)
        arm.follow(exploration.decide(advice((0.0, 0.03, True, 0.9)), on_top, "searching")[1])
    else:
        arm.follow(exploration.decide(None, Surroundings(np.eye(4)))[1])
    assert [type(act) for act in arm.acts] == [Lift, Approach, Touch]
    assert arm.acts[1].pose == pytest.approx(se3.translation([0, 0, 0.012]))


def test_the_next_try_begins_where_the_last_has_led():
    """A slide that is stopped within 2 mm has shown nothing, but the gel may have turned."""
    poses = iter([np.eye(4), turned := se3.exp(np.array([0, 0, 0, 0, 0.5, 0])), turned])
    arm, exploration = touched(
        lambda act: (True, "", 1e-3, True, np.eye(4) if isinstance(act, CheckReach) else next(poses)), asks=True
    )
    arm.follow(exploration.go([Motion(0.0, 0.03), Motion(1.0, 1e-3)], Surroundings(np.eye(4))))
    assert [type(act) for act in arm.acts[1:]] == [CheckReach, Slide] * 2, "the second did all that was asked"
    assert arm.acts[3].poses[-1][:3, 2] == pytest.approx(turned[:3, 2])


def test_a_finger_that_gets_nowhere_is_stuck_after_three_times():
    """It can touch where it is, but neither slide nor go elsewhere."""

    def script(act):
        able = isinstance(act, Touch | Lift) or (isinstance(act, Approach) and not act.pose[:2, 3].any())
        return able, "in the way", 0.0, isinstance(act, Touch | Slide), np.eye(4)

    arm, exploration = touched(script)
    for _ in range(3):
        assert exploration.verdict is None
        arm.follow(exploration.go([], Surroundings(np.eye(4))))
    assert exploration.verdict.words.endswith("nor touch elsewhere: in the way")


def test_a_pause_on_the_way_back_is_no_verdict():
    held = []
    arm = Scripted(lambda act: (held.append(act) or True, "", 0.0, False, np.eye(4)))
    exploration = Exploration(np.random.default_rng(0), 1.0, held=lambda: bool(held))
    Scripted(lambda act: (True, "", 0.0, True, np.eye(4))).follow(exploration.touch())
    exploration.motions.touching = False
    arm.follow(exploration.go([], Surroundings(np.eye(4))))
    assert arm.acts
    assert exploration.verdict is None


def test_while_it_is_held_it_begins_no_further_motion():
    """A motion that came to nothing, because nobody enables it any more, is not followed by others."""
    held = []
    arm = Scripted(lambda act: (held.append(act) or False, "not enabled", 0.0, True, np.eye(4)))
    exploration = Exploration(np.random.default_rng(0), 1.0, held=lambda: bool(held))
    for motion in (Motion(0.0, 0.03), Motion(0.0, 0.03, lift=True)):
        held.clear()
        exploration.motions.touching = True
        arm.acts.clear()
        arm.follow(exploration.go([motion] * 3, Surroundings(np.eye(4))))
        assert len(arm.acts) <= 2  # a lift that fails is put down again
    assert exploration.verdict is None


class TestReach:
    def test_what_the_arm_does_not_reach_is_left_out(self, world):
        heights = world.base_from_object[2, 3] + np.array([-0.1, 0.03 * np.cos(np.radians(60))])
        reach = Reach([-1, -1, heights[0]], [1, 1, 1], np.radians(70))
        exploration = Exploration(np.random.default_rng(4), 0.5, reach)
        followed(world, exploration.touch())
        for _ in range(12):
            followed(world, exploration.decide(advice((0.0, 0.06, True, 0.9), (0.0, 0.06, False, 0.9)), seen(world))[1])
            if exploration.verdict is not None:
                assert "out of the arm's reach" in exploration.verdict.words
                break
            assert world.base_from_gel[2, 2] > np.cos(np.radians(77))  # it is not quite steady

    def test_if_nothing_is_within_reach_it_ends_and_says_so(self, world, exploration):
        nowhere = Exploration(np.random.default_rng(4), 0.5, Reach([5, 5, 5], [6, 6, 6], np.pi))
        followed(world, nowhere.touch())
        reason, plan = nowhere.decide(advice((0.0, 0.03, True, 0.5), (0.0, 0.03, False, 0.5)), seen(world))
        assert reason == "somewhere, as nothing better is within reach"
        assert followed(world, plan)[0] == []
        assert nowhere.verdict.words.endswith("every way is out of the arm's reach")
        assert not followed(world, nowhere.motions.carry_out(Motion(0.0, 0.03, lift=True), seen(world)))[1]


class TestAskedReach:
    """Somebody who knows the arm is asked."""

    @staticmethod
    def follow(*motions, reaches):
        arm, exploration = touched(
            lambda act: (reaches or not isinstance(act, CheckReach), "joint 3", 0.03, True, np.eye(4)), asks=True
        )
        arm.follow(exploration.go(motions, Surroundings(np.eye(4))))
        return exploration, arm.acts[1:]

    def test_of_what_it_reaches_nothing_is_left_out(self):
        exploration, acts = self.follow(Motion(0.0, 0.03), reaches=True)
        assert [type(act) for act in acts] == [CheckReach, Slide]
        assert acts[0].poses[-2:, :3, 3] == pytest.approx(np.array([[0.03, 0, 0], [0.03, 0, 0.012]]))  # and off again
        assert exploration.verdict is None

    def test_a_leap_is_asked_for_from_its_lift_to_its_end(self):
        _, acts = self.follow(Motion(0.0, 0.03, lift=True), reaches=True)
        places = acts[0].poses[:, :3, 3]
        assert places[[0, -2, -1]] == pytest.approx(np.array([[0, 0, 0.012], [0.03, 0, 0.012], [0.03, 0, 0]]))
        assert [type(act) for act in acts if not isinstance(act, CheckReach)] == [Lift, Approach, Touch]


def test_it_knows_once_the_filter_is_sure_after_two_motions(exploration):
    for state in ("converged", "ambiguous", "converged"):
        exploration.judge(state, "", measured=True)
        assert exploration.verdict is None
    exploration.judge("converged", "one mode is left, modulo symmetry: 6 poses alike", measured=True)
    assert exploration.verdict.known
    assert "modulo symmetry: 6 poses alike" in exploration.verdict.words


def test_it_ends_once_two_motions_say_that_it_is_another_object(exploration):
    for unknown in (0.96, 0.9, 0.99):
        exploration.judge("lost", "", measured=True, unknown=unknown)
        assert exploration.verdict is None
    exploration.judge("lost", "these touches are not of this mesh", measured=True, unknown=0.97)
    assert not exploration.verdict.known
    assert exploration.verdict.foreign
    assert exploration.verdict.words == "another object is touched, with 97.0%: these touches are not of this mesh"


HOPELESS = advice(indistinguishable=True, message="(1, 2, 3) mm")


@pytest.mark.parametrize(
    ("happens", "words"),
    [
        (lambda it: it.judge("no_contact", "", measured=False), "measured nothing for 3 motions"),
        (lambda it: it.refused("not in contact"), "no suggestion where to touch next: not in contact"),
        (lambda it: it.decide(HOPELESS, Surroundings(np.eye(4))), "no motion tells the poses apart: (1, 2, 3) mm"),
    ],
    ids=["unmeasured", "refused", "hopeless"],
)
def test_it_gives_up_after_the_third_time_in_a_row(exploration, happens, words):
    for _ in range(2):
        happens(exploration)
        assert exploration.verdict is None
    happens(exploration)
    assert not exploration.verdict.known
    assert words in exploration.verdict.words


def test_what_goes_well_in_between_starts_the_count_anew(world, exploration):
    for _ in range(3):
        exploration.refused("why")
        exploration.decide(HOPELESS, seen(world))
        exploration.judge("no_contact", "", measured=False)
        exploration.judge("ambiguous", "", measured=True)
        exploration.decide(advice((0.0, 0.03, False, 0.3)), seen(world))
    assert exploration.verdict is None


def test_without_helpful_suggestions_it_looks_elsewhere(world, exploration):
    followed(world, exploration.decide(HOPELESS, seen(world))[1])
    assert (exploration.motions.slides, exploration.motions.lifts) == (0, 2)


def test_what_tells_much_is_done_though_it_settles_nothing(world, exploration):
    hardly = advice((0.0, 0.02, False, 0.4), indistinguishable=True)
    assert exploration.decide(hardly, seen(world))[0] == "worth 0.4"


def test_it_gives_up_after_the_longest_way(world, exploration):
    while exploration.motions.path <= 0.5:
        assert go(world, exploration, Motion(0.3, 0.1))
    exploration.judge("lost", "these touches are not of this mesh", measured=True)
    assert exploration.verdict.words.startswith("still lost after 0.5")
    assert exploration.verdict.words.endswith("these touches are not of this mesh")


def test_where_nothing_is_below_it_touches_beside_that(world):
    aside = world.finger.pose.copy()
    aside[:3, 3] += 0.035 * aside[:3, 0]
    world.finger.pose = aside
    exploration = Exploration(np.random.default_rng(4), 0.5, down=0.02)
    followed(world, exploration.touch())
    assert exploration.motions.touching
    assert exploration.verdict is None


def test_if_nothing_is_anywhere_it_ends():
    arm = Scripted(lambda act: (not isinstance(act, Touch), "nothing touched", 0.01, False, np.eye(4)))
    exploration = Exploration(np.random.default_rng(4), 0.5)
    arm.follow(exploration.touch())
    assert exploration.verdict.words == (
        "the finger reaches nothing below it: nothing touched; "
        "is the mount right, and does the sensor see what it touches?"
    )


def test_another_object_begins_anew(world, exploration):
    go(world, exploration)
    exploration.judge("converged", "", measured=True)
    exploration.restart()
    exploration.judge("converged", "", measured=True)
    assert (exploration.motions.path, exploration.motions.slides, exploration.motions.lifts) == (0.0, 0, 0)
    assert exploration.verdict is None


def test_a_verdict_stays_however_the_last_touch_is_judged_again():
    exploration = Exploration(np.random.default_rng(0), 1.0)
    exploration.judge("converged", "one mode is left", measured=True)
    Scripted(refusing).follow(exploration.go([], Surroundings(np.eye(4))))
    assert "not enabled" in exploration.verdict.words
    exploration.judge("converged", "one mode is left", measured=True)
    assert not exploration.verdict.known
