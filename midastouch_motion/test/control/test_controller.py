import dataclasses
import math

import numpy as np
import pytest

from midastouch_common import se3
from midastouch_motion.control.contact_servo import ContactServo, Limits
from midastouch_motion.control.controller import Controller
from midastouch_motion.control.guard import Guard, Seen
from midastouch_motion.control.measured import Measured
from midastouch_motion.control.skills import ApproachSkill, LiftSkill, SlideSkill, TouchSkill
from midastouch_motion.control.wrench import Sample

LIMITS, DEPTH, PERIOD = Limits(), 5e-4, 0.01
AREA, BIAS = 5e-5, np.array([3.0, 0.0, -4.0])  # m^2, N


class Driver:
    """A controller, stepped as by the node, an image and a pose in each period.

    What the gel feels is set by `depth`, and by `force` if the arm measures one; where it is by `gel`; `changes`, of
    what else is seen.
    """

    def __init__(self, skill, depth=0.0):
        guard = Guard(np.full(3, -0.1), np.full(3, 0.1), LIMITS.depth, force=10.0)
        self.controller = Controller(ContactServo(LIMITS, 0.05), guard)
        self.now, self.depth, self.gel, self.changes = 0.0, depth, np.eye(4), {}
        self.force = None
        self.begin(skill)

    def begin(self, skill):
        self.controller.begin(skill)

    def step(self):
        self.now += PERIOD
        flat, area = np.zeros(2), AREA if self.depth else 0.0
        seen = Measured(self.now - 0.02, self.depth, flat, flat, area, 0.5 * self.depth)
        self.controller.servo.measure(self.now, seen)
        if self.force is not None:
            self.controller.wrench.take(Sample(self.now, BIAS + self.force, self.gel[2, :3]))
        well = {"enabled": self.now, "image": self.now, "pose": self.now, "wrench": self.now}
        well |= {"listeners": 1, "commanders": 1, "gel": self.gel}
        twist, ended = self.controller.step(self.now, Seen(**well | self.changes))
        self.gel = self.gel @ se3.exp(PERIOD * twist)
        return twist, ended

    def run(self, periods):
        return [self.step()[0] for _ in range(periods)]

    def ended(self, before=lambda: None):
        """How the motion ends, and the twist then; `before` each step something happens."""
        for _ in range(3000):
            before()
            twist, ended = self.step()
            if ended is not None:
                return ended, twist
        raise AssertionError("no end within 30 s")


MOTIONS = {
    "lift": (lambda: LiftSkill(0.09), 0.0),
    "approach": (lambda: ApproachSkill(se3.exp(np.array([0.0, 0.08, 0.0, 0.0, 0.0, 1.0]))), 0.0),
    "touch": (lambda: TouchSkill(DEPTH, 0.09), 0.0),
    "slide": (lambda: SlideSkill(0.3, 0.09, DEPTH), DEPTH),
}
"""How each is made, and how deep the gel is meanwhile."""


def driver_of(motion):
    make, depth = MOTIONS[motion]
    return Driver(make(), depth)


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize(
    ("what", "value", "reason"), [("enabled", -math.inf, "not enabled"), ("force", 12.0, "a force")]
)
def test_a_fault_stops_each_motion_in_the_next_period(motion, what, value, reason):
    driver = driver_of(motion)
    assert np.linalg.norm(driver.run(20)[-1]) > 1e-3
    driver.changes = {what: value}
    twist, ended = driver.step()
    assert not twist.any()
    assert not ended.success
    assert ended.message.startswith(reason)


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("what", ["image", "pose", "enabled"])
def test_what_is_late_stops_each_motion_until_it_comes_and_ends_it_after_a_second(motion, what):
    driver = driver_of(motion)
    assert np.linalg.norm(driver.run(20)[-1]) > 1e-3
    driver.changes = {what: -1.0}
    assert not np.array(driver.run(40)).any()
    driver.changes = {}
    assert np.linalg.norm(driver.run(20)[-1]) > 1e-3
    driver.changes = {what: -1.0}
    began = driver.now
    ended, twist = driver.ended()
    assert not ended.success
    assert not twist.any()
    assert 0.9 < driver.now - began < 1.1


@pytest.mark.parametrize("jump", [se3.translation([0.0, 3e-3, 4e-3]), se3.exp(np.array([0, 0, 0, 0.1, 0, 0]))])
@pytest.mark.parametrize("motion", MOTIONS)
def test_a_transform_that_jumps_stops_all_but_a_way_off_the_surface(motion, jump):
    driver = driver_of(motion)
    driver.run(20)
    driver.gel = driver.gel @ jump
    twist, ended = driver.step()
    if motion == "lift":
        assert ended is None
        assert twist[2] > 1e-3
    else:
        assert "transform jumped by" in ended.message
        assert not twist.any()


def assert_goes_back(motion, ahead, back):
    """The twists `back` lead back on way and turn of the twist `ahead`, and off a surface on which the gel stayed."""
    way = -ahead[:3] / np.linalg.norm(ahead[:3])
    if motion == "slide":
        way = np.array([*way[:2], 1.0]) / np.linalg.norm([*way[:2], 1.0])
    back = np.array(back)
    speeds = np.linalg.norm(back[:, :3], axis=1)
    assert (speeds > 0).all()
    np.testing.assert_allclose(back[:, :3] / speeds[:, None], np.tile(way, (len(back), 1)), atol=0.05)
    turned = back[:, 3:] @ ahead[3:]
    assert (turned < 0).all() if motion == "approach" else not turned.any(), "and turns back"


@pytest.mark.parametrize("motion", ["approach", "touch", "slide"])
def test_too_deep_it_stops_in_the_next_period_then_goes_back(motion):
    driver = driver_of(motion)
    ahead = driver.run(40)[-1]
    driver.depth = 1.6e-3
    twist, ended = driver.step()
    assert not twist.any()
    assert ended is None
    assert_goes_back(motion, ahead, driver.run(10))
    driver.depth = 1e-4
    assert "mm deep, more than 1.00" in driver.ended()[0].message


@pytest.mark.parametrize("motion", ["approach", "touch", "slide"])
@pytest.mark.parametrize("depth", [8e-4, 0.0])
def test_a_depth_that_cannot_be_seen_stops_it_at_once(motion, depth):
    driver = driver_of(motion)
    ahead = driver.run(40 if motion == "slide" else 20)[-1]
    driver.changes = {"unread": "the contact covers the view"}
    driver.depth = depth
    assert not driver.step()[0].any()
    at = driver.gel[:3, 3].copy()
    assert_goes_back(motion, ahead, driver.run(5))
    driver.depth = 0.0
    assert "covers the view" in driver.ended()[0].message
    assert np.linalg.norm(driver.gel[:3, 3] - at) > 1.5e-3, "free of whatever depth it had"


def felt_driver(motion):
    """A driver under way, whose arm has measured forces in the air before."""
    driver = Driver(LiftSkill(1e-3))
    driver.force = np.zeros(3)
    driver.ended()
    make, driver.depth = MOTIONS[motion]
    driver.force = np.array([0.0, 0.0, 1.0 if driver.depth else 0.0])
    driver.begin(make())
    assert np.linalg.norm(driver.run(20)[-1]) > 1e-3
    return driver


@pytest.mark.parametrize("motion", ["approach", "touch", "slide"])
@pytest.mark.parametrize("force", [(0.0, 7.0, 1.0), (0.0, 0.0, -9.0), (0.0, 0.0, 9.0)])
def test_a_force_that_no_depth_explains_stops_it_within_two_periods_then_it_backs_off(motion, force):
    driver = felt_driver(motion)
    driver.force = np.array(force)
    assert not driver.step()[0].any()
    at = driver.gel[:3, 3].copy()
    ended = driver.ended()[0]
    assert not ended.success
    assert "across the gel and" in ended.message
    assert np.linalg.norm(driver.gel[:3, 3] - at) > 1.5e-3, "back"


def test_a_force_is_awaited_to_show_in_an_image_and_then_the_touch_goes_on():
    driver = felt_driver("touch")
    driver.force = np.array([0.0, 0.0, 5.0])
    driver.run(1)
    driver.force, driver.depth = np.zeros(3), 2e-4
    assert not any(twist.any() for twist in driver.run(4)), "it stands until an image was taken since"
    driver.force = np.array([0.0, 0.0, 5.0])
    assert driver.run(10)[-1][2] < 0, "and goes on to the depth that is wanted"
    driver.depth = DEPTH
    assert driver.ended()[0].success


def test_a_bias_that_was_taken_under_a_force_is_taken_again_in_the_air():
    driver = Driver(TouchSkill(DEPTH, 0.09))
    driver.force = np.array([0.0, 8.0, 0.0])
    driver.run(20)
    driver.force = np.zeros(3)
    assert "no image shows a contact" in driver.ended()[0].message
    driver.begin(TouchSkill(DEPTH, 0.02))
    assert "nothing touched within 20 mm" in driver.ended()[0].message


@pytest.mark.parametrize("seen", [{"depth": 3e-4}, {"unread": "neither a contact nor a free gel"}])
def test_under_a_contact_no_bias_is_taken(seen):
    driver = Driver(SlideSkill(0.0, 0.09, DEPTH))
    driver.force, driver.depth = np.array([0.0, 0.0, 9.0]), seen.pop("depth", 0.0)
    driver.changes = seen
    driver.run(5)
    assert "bias unknown" in driver.controller.wrench.describe()["force"]


def test_a_gel_that_leaves_may_feel_any_force():
    driver = felt_driver("slide")
    driver.begin(LiftSkill(0.01))
    driver.force = np.array([0.0, 9.0, -6.0])
    assert driver.ended()[0].success


def test_an_arm_that_stops_giving_its_force_is_stopped():
    driver = Driver(LiftSkill(0.05))
    driver.controller.guard = dataclasses.replace(driver.controller.guard, force=np.inf)
    driver.changes = {"wrench": -np.inf}
    assert driver.run(20)[-1].any(), "without a force"
    driver.changes = {"wrench": 0.0}
    assert "the newest force on wrench_topic is" in driver.ended()[0].message


def test_a_gel_that_meets_something_stops_before_it_goes_back():
    driver = driver_of("approach")
    ahead = driver.run(20)[-1]
    driver.depth = 3e-4
    assert not driver.step()[0].any()
    assert_goes_back("approach", ahead, driver.run(5))


@pytest.mark.parametrize("motion", MOTIONS)
def test_each_motion_accelerates_from_rest_after_any_pause(motion):
    driver = driver_of(motion)
    driver.run(20)
    driver.now += 3.0
    driver.begin(MOTIONS[motion][0]())
    twists = np.array([np.zeros(6), *driver.run(20)])
    changes = np.linalg.norm(np.diff(twists, axis=0)[:, :3], axis=1)
    assert 0 < changes.max() <= LIMITS.acceleration * PERIOD + 1e-9


def test_a_gel_pressed_too_hard_may_lift_but_into_nothing_else():
    driver = Driver(LiftSkill(0.05), depth=1.6e-3)
    driver.changes = {"force": 31.0}
    assert driver.run(20)[-1][2] > 0
    driver.changes, driver.depth = {}, 0.0
    driver.run(20)
    driver.changes = {"force": 12.0}
    twist, ended = driver.step()
    assert not twist.any()
    assert ended.message == "a force of 12.0 N, more than 10.0"


def test_what_presses_deep_and_strongly_is_pulled_back():
    driver = driver_of("slide")
    driver.run(40)
    driver.depth, driver.changes = 1.6e-3, {"force": 31.0}
    assert driver.run(5)[-1][2] > 0
    driver.depth, driver.changes = 1e-4, {}
    assert "deep, more than" in driver.ended()[0].message


def test_out_of_the_box_only_ways_back_are_gone():
    driver = Driver(LiftSkill(0.2))
    driver.gel = se3.translation([0.0, 0.0, 0.08])
    ended, twist = driver.ended()
    assert not twist.any()
    assert "outside of the box" in ended.message
    assert driver.gel[2, 3] < 0.101
    driver.begin(ApproachSkill(np.eye(4)))
    assert driver.ended()[0].success
    assert driver.gel[2, 3] < 0.002


def test_beyond_the_cone_it_is_lifted_and_turned_back():
    beyond = se3.exp(np.array([0, 0, 0, np.radians(70.0), 0, 0]))
    driver = Driver(LiftSkill(0.01))
    driver.controller.guard = dataclasses.replace(driver.controller.guard, cone=np.radians(60.0))
    driver.gel = beyond
    assert driver.ended()[0].success
    driver.begin(TouchSkill(DEPTH, 0.01))
    assert "outside of the cone" in driver.ended()[0].message
    driver.begin(ApproachSkill(np.eye(4)))
    assert driver.ended()[0].success


def test_a_pause_of_the_controller_is_no_fault_of_the_arm():
    """Which stops by itself meanwhile."""
    driver = Driver(LiftSkill(0.1))
    driver.run(2)
    driver.now += 1.0
    twist, ended = driver.step()
    assert ended is None, ended.message
    assert twist[2] > 0
