import re

import numpy as np
import pytest

from midastouch_common import se3
from midastouch_motion.control.guard import Guard, Seen

GUARD = Guard(np.array([-0.1] * 3), np.array([0.1] * 3), 1.5e-3, force=10.0, cone=np.radians(60.0))


def tilted(angle: float) -> np.ndarray:
    """A gel (4, 4) turned about its x axis by so many deg."""
    return se3.exp(np.array([0, 0, 0, np.radians(angle), 0, 0]))


def seen(**changes) -> Seen:
    well = {"enabled": 10.0, "image": 9.96, "pose": 9.99, "wrench": 9.98, "listeners": 1, "commanders": 1}
    return Seen(**well | changes)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({}, "^$"),
        ({"enabled": 9.8}, "not enabled"),
        ({"image": 9.85}, "the newest image is 150 ms old"),
        ({"image": -np.inf}, "no image came yet"),
        ({"pose": 9.0}, "the newest transform of the gel is 1000 ms old"),
        ({"enabled": 10.2}, "not enabled"),
        ({"image": 10.15}, "the newest image is 150 ms ahead of the clock"),
        ({"pose": 11.0}, "the newest transform of the gel is 1000 ms ahead of the clock"),
        ({"wrench": 9.85}, "the newest force on wrench_topic is 150 ms old"),
        ({"wrench": -np.inf}, "no force on wrench_topic came yet"),
        ({"wrench": 10.15}, "the newest force on wrench_topic is 150 ms ahead of the clock"),
        ({"bad_wrench": "the force is not a number"}, "the force is not a number"),
        ({"depth": 1.6e-3}, "1.60 mm deep, more than 1.50"),
        ({"unread": "the contact covers the view"}, "covers the view"),
        ({"gel": se3.translation([0.0, 0.2, 0.0])}, r"at \(0, 200, 0\) mm, outside"),
        ({"gel": tilted(70.0)}, "tilted by 70 deg, outside of the cone"),
    ],
)
def test_each_fault_stops_it(changes, reason):
    assert re.search(reason, GUARD.problem(10.0, seen(**changes)))


@pytest.mark.parametrize("angle", [-70.0, 70.0])
def test_outside_the_cone_a_gel_may_only_turn_back_or_leave(angle):
    def allowed(*twist: float) -> bool:
        return not GUARD.outside(seen(gel=tilted(angle)), np.array(twist))

    back = -np.sign(angle)
    assert allowed(0.01, 0, 0, 0.1 * back, 0, 0)
    assert allowed(0, 0, 0.01, 0, 0, 0)
    assert not allowed(0.01, 0, 0, 0, 0, 0)
    assert not allowed(0.01, 0, 0, -0.1 * back, 0, 0)
    assert not allowed(0, 0, 0.01, -0.1 * back, 0, 0)
    assert not allowed(0, 0, -0.01, 0, 0, 0)
    assert not GUARD.outside(seen(gel=tilted(0.8 * angle)), np.array([0, 0, -0.01, -0.1 * back, 0, 0]))


def test_a_stamp_a_little_ahead_of_the_clock_counts_as_now():
    """Else, where the clock went back, what comes no more would be taken for new until the clock is there again."""
    assert [GUARD.counted(10.0, stamp) for stamp in (9.9, 10.05, 10.5)] == [9.9, 10.0, 10.5]
