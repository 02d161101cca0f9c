import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from midastouch_common import se3
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.gates import GATES, Gates
from midastouch_filter.core.motion_model import Odometry, RestGate


def moved(x, yaw=0.0):
    return Odometry.from_matrix(se3.exp([x, 0, 0, 0, 0, yaw]))


def rest_gate(open_gates=(), **limits):
    return RestGate(FilterConfig(**limits), Gates(open_gates))


def test_what_is_skipped_is_counted_by_name_from_the_start():
    gates = Gates()
    assert set(gates.counts) == set(GATES)
    assert [gates.skips("wide_modes", needless) for needless in (True, False, True)] == [True, False, True]
    assert gates.counts["wide_modes"] == 2
    assert gates.counts["unrivalled"] == 0


def test_an_open_gate_skips_nothing_and_counts_nothing():
    gates = Gates(["unrivalled"])
    assert not gates.skips("unrivalled", True)
    assert gates.counts["unrivalled"] == 0
    assert gates.skips("wide_modes", True)


def test_a_refusal_is_counted_and_said():
    gates = Gates()
    gates.refuse("bad_code", "code is zero")
    gates.refuse("bad_code", "code is not finite")
    assert gates.counts["bad_code"] == 2
    assert gates.note == "code is not finite"


def test_rest_holds_back_small_steps_and_hands_on_their_sum():
    gates = Gates()
    gate = RestGate(FilterConfig(update_min_d=1e-3, update_min_a=0.1), gates)
    assert gate.motion(moved(4e-4)) is None
    assert gate.motion(moved(4e-4)) is None
    total = gate.motion(moved(4e-4))
    np.testing.assert_allclose(total.transform[:3, 3], [1.2e-3, 0, 0], atol=1e-12)
    assert gates.counts["at_rest"] == 2
    assert gate.motion(moved(0.0)) is None


def test_turning_on_the_spot_is_motion():
    assert rest_gate(update_min_d=1e-3, update_min_a=0.1).motion(moved(0.0, 0.2)) is not None


def test_rest_can_be_reset():
    gate = rest_gate(update_min_d=1e-3)
    gate.motion(moved(9e-4))
    gate.reset()
    assert gate.motion(moved(9e-4)) is None


def test_an_open_rest_gate_hands_on_every_step_once():
    gate = rest_gate(["at_rest"], update_min_d=1e-3)
    for _ in range(3):
        np.testing.assert_allclose(gate.motion(moved(4e-4)).transform[:3, 3], [4e-4, 0, 0], atol=1e-12)


@given(st.floats(-4.9e-4, 4.9e-4), st.integers(2, 30))
@settings(max_examples=20)
def test_rest_adds_up_rotations_that_are_not_quite_orthonormal(stretch, steps):
    """Each is within tolerance; their product would not be."""
    gates = Gates()
    gate = RestGate(FilterConfig(), gates)
    step = np.eye(4)
    step[:3, :3] *= 1 + stretch
    for _ in range(steps):
        assert gate.motion(Odometry.from_matrix(step)) is None
    assert gates.counts["at_rest"] == steps
