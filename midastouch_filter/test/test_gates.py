import numpy as np

from midastouch_filter import gates
from midastouch_filter.config import FilterConfig
from midastouch_filter.motion_model import Odometry
from midastouch_perception import se3


def moved(x, yaw=0.0):
    return Odometry.from_matrix(se3.exp([x, 0, 0, 0, 0, yaw]))


def test_rest_holds_back_small_steps_and_hands_on_their_sum():
    gate = gates.RestGate(FilterConfig(update_min_d=1e-3, update_min_a=0.1))
    assert gate.motion(moved(4e-4)) is None
    assert gate.motion(moved(4e-4)) is None
    total = gate.motion(moved(4e-4))
    np.testing.assert_allclose(total.transform[:3, 3], [1.2e-3, 0, 0], atol=1e-12)
    assert gate.skipped == 2
    assert gate.motion(moved(0.0)) is None


def test_turning_on_the_spot_is_motion():
    gate = gates.RestGate(FilterConfig(update_min_d=1e-3, update_min_a=0.1))
    assert gate.motion(moved(0.0, 0.2)) is not None


def test_rest_can_be_reset():
    gate = gates.RestGate(FilterConfig(update_min_d=1e-3))
    gate.motion(moved(9e-4))
    gate.reset()
    assert gate.motion(moved(9e-4)) is None


def test_an_open_gate_hands_on_every_step_once():
    gate = gates.RestGate(FilterConfig(update_min_d=1e-3))
    gate.open = True
    for _ in range(3):
        np.testing.assert_allclose(gate.motion(moved(4e-4)).transform[:3, 3], [4e-4, 0, 0], atol=1e-12)
    assert gate.skipped == 0


def test_an_open_gate_skips_nothing_and_counts_nothing():
    gate = gates.OccupiedGate()
    gate.open = True
    assert not gate.skips(1000, 50_000)
    assert gate.skipped == 0


def test_contact():
    gate = gates.ContactGate()
    assert [gate.skips(c) for c in (True, False, False)] == [False, True, True]
    assert gate.skipped == 2


def test_the_same_code_is_one_touch_until_reset():
    gate = gates.UnchangedCodeGate()
    a, b = np.array([1.0, 0.0], np.float32), np.array([0.0, 1.0], np.float32)
    assert [gate.skips(c) for c in (a, a.copy(), b, a)] == [False, True, False, False]
    gate.reset()
    assert not gate.skips(a)
    assert gate.skipped == 1


def test_effective_size():
    gate = gates.EffectiveSizeGate(FilterConfig(resample_ess=0.5))
    assert gate.skips(60.0, 100)
    assert not gate.skips(40.0, 100)
    assert gate.skipped == 1


def test_occupied_entries_when_they_are_few():
    gate = gates.OccupiedGate()
    assert not gate.skips(50_000, 50_000)
    assert gate.skips(1000, 50_000)


def test_unmoved():
    gate = gates.UnmovedGate()
    assert gate.skips(touched=False)
    assert not gate.skips(touched=True)


def test_unrivalled():
    gate = gates.UnrivalledGate()
    assert gate.skips(unrivalled=True)
    assert not gate.skips(unrivalled=False)
    assert gate.skipped == 1
