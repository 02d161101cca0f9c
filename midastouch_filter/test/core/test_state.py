import pytest

from midastouch_filter.core import state
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.state import StateEvidence, StateMachine


def narrow(**changes):
    known = {"mode_mass": 0.995, "error_t": 0.002, "error_r": 0.1, "trend": 9.0}
    return StateEvidence(**{"initialised": True, "in_contact": True} | known | changes)


@pytest.fixture
def machine():
    limits = {"converged_probability": 0.99, "converged_error": 0.005, "converged_rotation": 0.26}
    return StateMachine(FilterConfig(**limits, hysteresis=1.5))


def test_starts_uninitialised_and_says_so(machine):
    assert machine.state == state.UNINITIALISED
    assert machine.update(StateEvidence())[0] == state.UNINITIALISED


@pytest.mark.parametrize(
    ("evidence", "expected", "reason"),
    [
        (narrow(), state.CONVERGED, "100% within 2.0 mm"),
        (narrow(alike="6 poses alike"), state.CONVERGED, "modulo symmetry: 6 poses alike"),
        (narrow(mode_mass=0.5), state.AMBIGUOUS, "50%"),
        (narrow(error_t=0.03), state.AMBIGUOUS, "known to 30.0 mm only"),
        (narrow(error_r=0.4), state.AMBIGUOUS, "known to 0.40 rad only"),
        (narrow(in_contact=False), state.NO_CONTACT, "touches nothing"),
        (narrow(trend=-0.1), state.LOST, "contradict"),
        (narrow(restarted="odometry jumped"), state.LOST, "odometry jumped"),
        (narrow(unknown=0.1), state.CONVERGED, "100%"),
        (narrow(unknown=0.4), state.AMBIGUOUS, "with a probability of 40% these touches are not of this mesh"),
        (narrow(unknown=0.97), state.LOST, "these touches are not of this mesh"),
        (narrow(unknown=0.97, in_contact=False), state.NO_CONTACT, "touches nothing"),
        (narrow(trend=-0.1, in_contact=False), state.NO_CONTACT, "touches nothing"),
        (narrow(mode_mass=0.5, listed=0.85), state.SEARCHING, "15% of the weight"),
        (narrow(mode_mass=0.5, listed=0.95), state.AMBIGUOUS, "50%"),
        (narrow(listed=0.5, trend=-0.1), state.LOST, "contradict"),
        (narrow(listed=0.5, in_contact=False), state.NO_CONTACT, "touches nothing"),
    ],
)
def test_each_state_has_its_evidence_and_reason(machine, evidence, expected, reason):
    got, why = machine.update(evidence)
    assert got == expected
    assert reason in why
    assert got in state.STATES


@pytest.mark.parametrize(("wide", "too_wide"), [({"error_t": 0.006}, {"error_t": 0.008}),
                                               ({"error_r": 0.35}, {"error_r": 0.45})])  # fmt: skip
def test_does_not_flicker_at_the_limit_of_convergence(machine, wide, too_wide):
    states = [machine.update(narrow(**each))[0] for each in (wide, {}, wide, too_wide, wide)]
    assert states == [state.AMBIGUOUS, state.CONVERGED, state.CONVERGED, state.AMBIGUOUS, state.AMBIGUOUS]


def test_is_found_again_only_well_above_the_limit_of_being_lost(machine):
    states = [machine.update(narrow(trend=trend))[0] for trend in (-1.0, 1.0, 3.0, 1.0)]
    assert states == [state.LOST, state.LOST, state.CONVERGED, state.CONVERGED]


def test_remembers_being_lost_through_the_air(machine):
    machine.update(narrow(trend=-1.0))
    machine.update(narrow(trend=1.0, in_contact=False))
    assert machine.update(narrow(trend=1.0))[0] == state.LOST


def test_a_start_forgets_that_it_was_lost(machine):
    machine.update(narrow(trend=-1.0))
    machine.update(StateEvidence())
    assert machine.update(narrow(trend=1.0))[0] == state.CONVERGED


def test_a_foreign_object_is_said_once_sure_until_improbable(machine):
    said = []
    for unknown in (0.9, 0.96, 0.6, 0.4, 0.6):
        machine.update(narrow(unknown=unknown))
        said.append(machine.foreign)
    assert said == [False, True, True, False, False]
    assert machine.update(narrow(trend=-1.0))[0] == state.LOST
    assert not machine.foreign
