import pytest

from midastouch_filter.core import state
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.state import StateEvidence, StateMachine


def narrow(**changes):
    return StateEvidence(
        **{"initialised": True, "in_contact": True, "mode_mass": 0.95, "spread_t": 0.002, "spread_r": 0.1} | changes
    )


@pytest.fixture
def machine():
    return StateMachine(FilterConfig(converged_mass=0.8, converged_translation=0.005, hysteresis=1.5))


def test_starts_uninitialised_and_says_so(machine):
    assert machine.state == state.UNINITIALISED
    assert machine.update(StateEvidence())[0] == state.UNINITIALISED


@pytest.mark.parametrize(
    ("evidence", "expected", "reason"),
    [
        (narrow(), state.CONVERGED, "95%"),
        (narrow(alike="6 poses alike"), state.CONVERGED, "modulo symmetry: 6 poses alike"),
        (narrow(mode_mass=0.5), state.AMBIGUOUS, "50%"),
        (narrow(spread_t=0.02), state.AMBIGUOUS, "20.0 mm"),
        (narrow(doubt="the last touch does not fit it"), state.AMBIGUOUS, "but the last touch does not fit it"),
        (narrow(spread_r=1.0), state.AMBIGUOUS, "1.00 rad"),
        (narrow(error_t=0.03), state.AMBIGUOUS, "known to 30.0 mm only"),
        (narrow(error_r=0.4), state.AMBIGUOUS, "known to 0.40 rad only"),
        (narrow(in_contact=False), state.NO_CONTACT, "touches nothing"),
        (narrow(support=0.45), state.AMBIGUOUS, "fit the particles badly"),
        (narrow(support=0.9), state.LOST, "contradict"),
        (narrow(restarted="odometry jumped"), state.LOST, "odometry jumped"),
        (narrow(unknown=0.4), state.CONVERGED, "95%"),
        (narrow(unknown=0.6), state.AMBIGUOUS, "with 60% these touches are not of this mesh"),
        (narrow(unknown=0.97), state.LOST, "these touches are not of this mesh"),
        (narrow(unknown=0.97, in_contact=False), state.NO_CONTACT, "touches nothing"),
        (narrow(support=0.9, in_contact=False), state.NO_CONTACT, "touches nothing"),
        (narrow(mode_mass=0.5, listed=0.85), state.SEARCHING, "with 15% the pose is none"),
        (narrow(mode_mass=0.5, listed=0.95), state.AMBIGUOUS, "50%"),
        (narrow(listed=0.85), state.CONVERGED, "95%"),
        (narrow(listed=0.5, support=0.9), state.LOST, "contradict"),
        (narrow(listed=0.5, in_contact=False), state.NO_CONTACT, "touches nothing"),
    ],
)
def test_each_state_has_its_evidence_and_reason(machine, evidence, expected, reason):
    got, why = machine.update(evidence)
    assert got == expected
    assert reason in why
    assert got in state.STATES


def test_does_not_flicker_at_the_limit_of_convergence(machine):
    wide = narrow(spread_t=0.006)
    assert machine.update(wide)[0] == state.AMBIGUOUS
    assert machine.update(narrow())[0] == state.CONVERGED
    assert machine.update(wide)[0] == state.CONVERGED
    assert machine.update(narrow(spread_t=0.008))[0] == state.AMBIGUOUS
    assert machine.update(wide)[0] == state.AMBIGUOUS


def test_a_wider_error_is_borne_once_converged(machine):
    wide = narrow(error_t=0.006)
    assert machine.update(wide)[0] == state.AMBIGUOUS
    assert machine.update(narrow(error_t=0.004))[0] == state.CONVERGED
    assert machine.update(wide)[0] == state.CONVERGED
    assert machine.update(narrow(error_t=0.008))[0] == state.AMBIGUOUS


def test_is_found_again_only_well_below_the_limit_of_being_lost(machine):
    assert machine.update(narrow(support=0.7))[0] == state.LOST
    assert machine.update(narrow(support=0.45))[0] == state.LOST
    assert machine.update(narrow(support=0.2))[0] == state.CONVERGED
    assert machine.update(narrow(support=0.45))[0] == state.AMBIGUOUS


def test_remembers_being_lost_through_the_air(machine):
    machine.update(narrow(support=0.7))
    machine.update(narrow(support=0.45, in_contact=False))
    assert machine.update(narrow(support=0.45))[0] == state.LOST


def test_another_object_is_said_only_when_that_is_certain_and_taken_back_once_it_is_improbable(machine):
    said = []
    for unknown in (0.9, 0.96, 0.6, 0.4, 0.6):
        machine.update(narrow(unknown=unknown))
        said.append(machine.foreign)
    assert said == [False, True, True, False, False]
    assert machine.update(narrow(support=0.9))[0] == state.LOST
    assert not machine.foreign
