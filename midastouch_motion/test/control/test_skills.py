"""The motions in closed loop: late images, a late arm, measured depths."""

import numpy as np
import pytest
from simulated_arm import SimulatedArm

from midastouch_common import se3
from midastouch_motion.control.contact_servo import ContactServo, Limits
from midastouch_motion.control.measured import Measured
from midastouch_motion.control.skills import ApproachSkill, BackOffSkill, LiftSkill, SlideSkill, TouchSkill
from midastouch_simulation.rehearsal import Rehearsal

from ..conftest import above, controller_of

DEPTH = 0.5e-3
CORNER = [2e-3, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 2e-3, 0.0, 0.1, 0.0]
DELAYS = [(0.02, 0.02, 60.0), (0.05, 0.05, 30.0), (0.08, 0.08, 30.0)]


@pytest.mark.parametrize(("image_delay", "arm_latency", "fps"), DELAYS)
@pytest.mark.parametrize("name", ["ball", "handle_tool", "eyebolt"])
def test_a_touch_stops_in_time_and_holds_its_depth(world, name, image_delay, arm_latency, fps):
    there = world(name, image_delay=image_delay, arm_latency=arm_latency, fps=fps)
    rng = np.random.default_rng(1)
    for _ in range(3):
        run = there.run(above(there.mesh, rng, 5e-3, np.radians(3)), [TouchSkill(DEPTH, 0.03)])
        assert run.ended[0].success, run.ended[0].message
        assert max(run.depths) < 1.5e-3
        assert there.depth(run.pose) == pytest.approx(DEPTH, abs=2.5e-4)


@pytest.mark.parametrize(("image_delay", "arm_latency", "fps"), DELAYS)
def test_a_slide_keeps_its_depth(world, image_delay, arm_latency, fps):
    there = world("ball", image_delay=image_delay, arm_latency=arm_latency, fps=fps)
    rng = np.random.default_rng(2)
    for heading in (0.3, 3.0):
        touch = there.run(above(there.mesh, rng, 3e-3), [TouchSkill(DEPTH, 0.02)])
        run = there.run(touch.pose, [SlideSkill(heading, 0.04, DEPTH)])
        assert run.ended[0].success, run.ended[0].message
        inside = np.abs(np.array(run.depths) - DEPTH) < 2.5e-4
        assert inside.mean() > 0.95
        assert max(run.depths) < 1.5e-3


@pytest.mark.slow
def test_over_an_edge_a_slide_ends_with_a_reason_and_never_deep(world):
    there = world("handle_tool")
    rng = np.random.default_rng(3)
    for _ in range(3):
        touch = there.run(above(there.mesh, rng, 3e-3), [TouchSkill(DEPTH, 0.02)])
        run = there.run(touch.pose, [SlideSkill(rng.uniform(0, 6.28), 0.1, DEPTH)])
        assert run.ended[0] is not None
        assert run.ended[0].message
        assert max(run.depths) < 1.5e-3


def test_where_nothing_is_a_touch_ends(world):
    there = world("ball")
    pose = above(there.mesh, np.random.default_rng(4), 0.05)
    run = there.run(pose, [TouchSkill(DEPTH, 0.01)])
    assert not run.ended[0].success
    assert "nothing touched within 10 mm" in run.ended[0].message
    assert np.linalg.norm(run.pose[:3, 3] - pose[:3, 3]) < 0.012


def rehearsed(look, limits=None, centre=lambda pose: np.zeros(2), force=lambda pose: np.zeros(3)):
    """A gel at the origin, to which `look(pose)` [m] is the depth, `centre(pose)` that of the contact, and
    `force(pose)` what the arm measures."""
    arm, controller = SimulatedArm(np.eye(4)), controller_of(limits or Limits())

    def measured(pose):
        depth = look(pose)
        return Measured(0.0, depth, np.zeros(2), centre(pose), 5e-5 * (depth > 0), depth / 2)

    how = measured, controller, 30.0, lambda: 0.05, lambda: force(arm.pose)
    return Rehearsal(arm, lambda: arm.pose, *how), arm


def test_a_press_deeper_than_images_show_is_pulled_back():
    """From 1.2 mm on, the read depth falls again, down to that of no contact."""
    deepest = 0.0

    def look(pose):
        nonlocal deepest
        depth = -pose[2, 3] - 5e-3
        deepest = max(deepest, depth)
        return max(min(depth, 2.4e-3 - depth), 0.0)

    there, arm = rehearsed(look, Limits(depth=1.9e-3))
    ended = there.carry_out(TouchSkill(1.5e-3, 0.02), 60.0)
    assert not ended.success
    assert "its depth falls although it is pressed on" in ended.message
    assert deepest < 2.2e-3
    assert arm.pose[2, 3] > -5e-3, "pulled back"


@pytest.mark.parametrize("depth", [3e-4, 1.2e-3])
def test_a_depth_that_falls_because_the_gel_leaves_is_no_press(depth):
    there, _ = rehearsed(lambda pose: max(-pose[2, 3] - 5e-3, 0.0), Limits(depth=1.9e-3))
    assert there.carry_out(TouchSkill(depth, 0.02), 60.0).success
    assert there.carry_out(LiftSkill(5e-3), 60.0).success
    assert there.carry_out(TouchSkill(depth, 0.02), 60.0).success


def test_a_slide_leaves_from_under_a_wall_as_it_came():
    """A wall 5 mm on, 8 mm beside the apex, which is deeper in the gel the farther on and the higher this is."""
    wall = []

    def look(pose):
        wall.append(max(0.5 * (pose[0, 3] - 5e-3) + 0.1 * (pose[2, 3] + DEPTH), 0.0))
        return max(-pose[2, 3], wall[-1])

    def centre(pose):
        return np.array([8e-3 if wall[-1] > -pose[2, 3] else 0.0, 0.0])

    there, arm = rehearsed(look, Limits(speed=3e-3, depth=1.4e-3), centre)
    assert there.carry_out(TouchSkill(DEPTH, 0.02), 20.0).success
    ended = there.carry_out(SlideSkill(0.0, 0.03, DEPTH), 30.0)
    assert "a wall leans over it" in ended.message
    assert max(wall) < 1.6e-3
    assert wall[-1] == 0
    assert 0 < arm.pose[0, 3] < 5e-3, "on the way that it has come"


def test_under_a_wall_a_lift_goes_aside():
    """The gel is where its motion begins; straight off, the wall gets deeper."""
    met = []

    def look(pose):
        met.append(max(1e-3 + pose[0, 3] + 0.5 * pose[2, 3], 0.0))
        return met[-1]

    there, _ = rehearsed(look, Limits(depth=1.4e-3), centre=lambda pose: np.array([8e-3, 0.0]))
    for _ in range(4):
        there.carry_out(LiftSkill(5e-3), 20.0)
    assert met[-1] == 0
    assert max(met) < 2e-3


def test_what_gives_way_is_not_followed_for_ever():
    """Light, soft or hanging free: the gel sinks in by 0.2 mm and takes it along."""
    there, arm = rehearsed(lambda pose: 2e-4 if pose[2, 3] < -5e-3 else 0.0)
    ended = there.carry_out(TouchSkill(DEPTH, 0.02), 60.0)
    assert ended.message.startswith("what touches gives way")
    assert not ended.success
    assert arm.pose[2, 3] > -0.03


def test_a_touch_gets_over_what_its_rim_touches():
    there, arm = rehearsed(lambda pose: 5e-4, centre=lambda pose: np.array([9e-3 - pose[0, 3], 0.0]))
    ended = there.carry_out(TouchSkill(DEPTH, 0.02), 20.0)
    assert ended.success, ended.message
    assert 2.5e-3 < arm.pose[0, 3] < 5e-3


def test_a_slide_waits_for_a_contact_behind_but_not_for_ever():
    """5 mm on the contact is behind, for three images or from then on."""
    for images, said in ((3, "slid 20 mm"), (1000, "over an edge")):
        left = iter(range(images))

        def behind(pose, left=left):
            return np.array([-7e-3 if pose[0, 3] > 5e-3 and next(left, None) is not None else 0.0, 0.0])

        there, _ = rehearsed(lambda pose: 5e-4, centre=behind)
        assert said in there.carry_out(SlideSkill(0.0, 0.02, DEPTH), 60.0).message


def test_a_wall_that_no_image_shows_ends_a_slide_at_once():
    """20 N/mm stiff, 5 mm on; the arm's force has a bias."""

    def force(pose):
        return np.array([3.0 - 2e4 * max(pose[0, 3] - 5e-3, 0.0), 0.0, -4.0])

    there, arm = rehearsed(lambda pose: max(-pose[2, 3], 0.0), force=force)
    assert there.carry_out(LiftSkill(2e-3), 20.0).success
    assert there.carry_out(TouchSkill(DEPTH, 0.02), 20.0).success
    farthest = []
    ended = there.carry_out(SlideSkill(0.0, 0.03, DEPTH), 20.0, lambda _: farthest.append(arm.pose[0, 3]))
    assert "its rim touches something" in ended.message
    assert max(farthest) < 6e-3
    assert arm.pose[2, 3] > 1e-3, "pulled back"


def test_a_touch_that_comes_and_goes_ends():
    """Read too deep from the first image on, it is left again, and again."""
    there, _ = rehearsed(lambda pose: 6.5e-4 if pose[2, 3] < -5e-3 else 0.0, Limits(depth=1.5e-3))
    ended = there.carry_out(TouchSkill(DEPTH, 0.02), 60.0)
    assert ended is not None
    assert not ended.success
    assert "does not settle" in ended.message
    turn, approach = np.pi / 2 / Limits().turn_speed, 5e-3 / 3.5e-3
    assert there.now == pytest.approx(approach + turn + 3.0, abs=1.0)


@pytest.mark.slow
def test_what_a_slide_goes_up_and_down_is_no_way_along():
    there, arm = rehearsed(lambda pose: 1.1e-3 if pose[2, 3] < 0 else 0.0, Limits(depth=1.4e-3))
    there.carry_out(TouchSkill(DEPTH, 0.02), 3.0)
    slide = SlideSkill(0.0, 0.03, DEPTH)
    ended = there.carry_out(slide, 300.0)
    assert ended is not None
    assert slide.path == pytest.approx(arm.pose[0, 3], rel=0.1, abs=2e-3)


def test_a_slide_that_does_not_get_on_ends():
    """Read so deep that it does not slide, and is not pulled back."""
    there, _ = rehearsed(lambda pose: 1.2e-3, Limits(depth=1.4e-3))
    ended = there.carry_out(SlideSkill(0.0, 0.03, DEPTH), 60.0)
    assert ended is not None
    assert "it gets no further than" in ended.message


def test_a_slide_that_loses_its_contact_at_once_looks_for_it():
    there, arm = rehearsed(lambda pose: 5e-4 if pose[0, 3] < 1e-4 else 0.0)
    ended = there.carry_out(SlideSkill(0.0, 0.03, DEPTH), 20.0)
    assert "was lost after 0 mm" in ended.message
    assert arm.pose[2, 3] < -1e-3


def test_lift_goes_straight_up(world):
    there = world("ball")
    touch = there.run(above(there.mesh, np.random.default_rng(6), 3e-3), [TouchSkill(DEPTH, 0.02)])
    run = there.run(touch.pose, [LiftSkill(0.02)])
    assert run.ended[0].success
    way = touch.pose[:3, :3].T @ (run.pose[:3, 3] - touch.pose[:3, 3])
    np.testing.assert_allclose(way, [0, 0, 0.02], atol=2e-3)
    assert there.depth(run.pose) == 0


def test_what_backs_off_retraces_the_last_way_of_its_motion_alone():
    """A way around a corner, and a turn; then a motion that has not moved."""
    servo, pose = ContactServo(Limits(), 0.05), np.eye(4)
    there = [pose := pose @ se3.exp(np.array(way) / 10) for way in 10 * [CORNER[0]] + 10 * [CORNER[1]]]
    for begins in (True, False):
        servo.begin(0.0)
        for passed in there if begins else []:
            servo.pass_by(0.0, passed)
        servo.measure(0.1, Measured(0.1, 2e-3, np.zeros(2), np.zeros(2)))
        skill, pose = BackOffSkill(), there[-1]
        for period in range(43):
            pose = pose @ se3.exp(0.01 * skill.step(servo, 0.1 + 0.01 * period, pose))
        expected = there[4] if begins else there[-1] @ se3.translation([0.0, 0.0, 4.3e-3])
        np.testing.assert_allclose(pose, expected, atol=5e-4)


def test_a_lift_that_meets_what_overhangs_goes_back_down():
    """From a floor at 0 to a ceiling 8 mm above it."""
    there, arm = rehearsed(lambda pose: max(-pose[2, 3], pose[2, 3] - 8e-3, 0.0))
    assert there.carry_out(TouchSkill(DEPTH, 0.02), 20.0).success
    highest = []
    ended = there.carry_out(LiftSkill(0.02), 20.0, lambda _: highest.append(arm.pose[2, 3]))
    assert not ended.success
    assert "touched on the way after 9 mm" in ended.message
    assert 8e-3 < max(highest) < 9e-3
    assert 2e-3 < arm.pose[2, 3] < 8e-3


def test_an_approach_reaches_a_turned_pose_through_the_air(world):
    there = world("ball", image_delay=0.08, arm_latency=0.08)
    start = above(there.mesh, np.random.default_rng(8), 0.02)
    goal = start @ se3.exp(np.array([0.03, 0.01, 0.02, 0.3, -0.2, 0.5]))
    run = there.run(start, [ApproachSkill(goal)])
    assert run.ended[0].success, run.ended[0].message
    left = se3.inverse(goal) @ run.pose
    assert np.linalg.norm(left[:3, 3]) < 1e-3
    assert se3.rotation_angle(left[:3, :3]) < np.radians(1)
    assert max(run.depths) == 0


def test_a_touch_on_the_way_ends_an_approach_and_it_backs_off(world):
    there = world("ball", limits=Limits(depth=5e-3))
    start = above(there.mesh, np.random.default_rng(9), 0.02)
    through = start @ se3.translation([0, 0, -0.06])
    run = there.run(start, [ApproachSkill(through)])
    assert not run.ended[0].success
    assert max(run.depths) < 3e-3
    assert "touched on the way after" in run.ended[0].message
    assert there.depth(run.pose) == 0
    assert there.run(run.pose, [ApproachSkill(start)]).ended[0].success, "the way back is free"


def test_an_arm_that_does_not_follow_ends_every_motion(world):
    there = world("ball", arm_timeout=0.0)
    pose = above(there.mesh, np.random.default_rng(8), 0.02)
    elsewhere, turned = se3.translation([0.02, 0, 0]), se3.exp(np.array([0, 0, 0, 0, 0, 1.0]))
    for skill in (
        TouchSkill(DEPTH, 0.1),
        LiftSkill(0.01),
        ApproachSkill(pose @ elsewhere),
        ApproachSkill(pose @ turned),
    ):
        run = there.run(pose, [skill])
        assert run.ended[0] is not None
        assert "does not follow" in run.ended[0].message
