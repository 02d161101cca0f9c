import numpy as np
import pytest
from cad_symmetries import EXACT

from midastouch_benchmark.trials.cad_parts import CAD_PARTS, SMALL_CAD_PARTS
from midastouch_benchmark.trials.yardstick import Yardstick
from midastouch_common import se3
from midastouch_perception.symmetry.group import Symmetry

TRUTH = se3.make(se3.random_rotations(1, np.random.default_rng(0))[0], np.array([0.02, -0.01, 0.03]))


def off(metres: float = 0.0, degrees: float = 0.0) -> np.ndarray:
    """The truth, so far away and turned."""
    pose = TRUTH @ se3.exp(np.array([0, 0, 0, np.radians(degrees), 0, 0]))
    pose[0, 3] += metres
    return pose


def yardstick(name: str) -> Yardstick:
    return Yardstick.of((CAD_PARTS | SMALL_CAD_PARTS)[name](name), EXACT[name])


def test_both_distance_and_turn_count():
    poses = np.array([off(0.009, 19), off(0.011), off(0, 21), off()])
    assert yardstick("bracket_left").right(poses, TRUTH).tolist() == [True, False, False, True]


def test_a_small_part_is_judged_by_its_size():
    small = yardstick("three_pin_plug")  # 27 mm across
    assert small.right(np.array([off(0.0025), off(0.003), off(0.009)]), TRUTH).tolist() == [True, False, False]
    assert small.describe() == {"right_m": pytest.approx(0.1 * np.linalg.norm([18, 12, 16]) / 1e3), "right_deg": 20}


def test_another_side_is_right_only_if_no_touch_tells_it():
    sixth, twelfth = (se3.exp(np.array([0, 0, 0, 0, 0, np.radians(angle)])) for angle in (60, 30))
    poses = np.array([sixth @ TRUTH, twelfth @ TRUTH])
    assert yardstick("bottle_6").right(poses, TRUTH).tolist() == [True, False]
    assert yardstick("bottle_6_labelled").right(poses, TRUTH).tolist() == [False, False]
    assert yardstick("cone").right(poses, TRUTH).tolist() == [True, True]


def test_a_turn_about_a_free_axis_is_no_error():
    free = Yardstick(Symmetry(free="axis"))
    tilted = np.array([se3.exp(np.array([0, 0, 0, np.radians(30), 0, 0])) @ off()])
    turned = np.array([se3.exp(np.array([0, 0, 0, 0, 0, 2.0])) @ off(0.001)])
    assert free.right(turned, TRUTH).tolist() == [True]
    assert free.right(tilted, TRUTH).tolist() == [False]


def test_nothing_is_right_without_a_truth_or_poses():
    nowhere = np.full((4, 4), np.nan)
    assert Yardstick().right(np.array([off()]), nowhere).tolist() == [False]
    assert Yardstick().right(np.zeros((0, 4, 4)), TRUTH).tolist() == []
