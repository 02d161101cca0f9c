"""Three ellipsoids with bumps at other hypotheses: which one is slid over?"""

from dataclasses import replace

import numpy as np
import pytest

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.noise_model import NoiseModel
from midastouch_filter.core.pose_hypothesis import PoseHypothesis
from midastouch_filter.core.touch import Measurement
from midastouch_filter.identification.identification import Identification
from midastouch_filter.identification.identity import UNKNOWN
from midastouch_filter.smoothing.contest import Contest

CONFIG = FilterConfig(threads=1)
NOISE = NoiseModel.of(CONFIG)


def identified(catalogue, frames):
    identification = Identification(catalogue, CONFIG, NOISE)
    for moved, touch in frames:
        identification.step(moved, touch)
    return identification.identity


@pytest.mark.parametrize("k", [0, 1, 2])
def test_the_object_and_the_pose_are_found(shelf, k):
    truth, frames = shelf.touches(k)
    identity = identified(shelf.catalogue, frames)
    assert identity.answer == f"bumpy_{k + 1}"
    assert identity.leading.probability > 0.9
    assert np.linalg.norm(identity.leading.hypotheses[0].pose[:3, 3] - truth[-1][:3, 3]) < 2e-3


def test_an_object_that_is_not_in_the_catalogue_is_unknown(shelf):
    _, frames = shelf.touches(1)
    identity = identified(shelf.catalogue.without("bumpy_2"), frames)
    assert identity.answer == UNKNOWN
    assert identity.unknown > 0.9


def test_an_object_that_is_exchanged_while_the_sensor_is_lifted_is_found(shelf):
    _, first = shelf.touches(0, steps=100)
    truth, second = shelf.touches(1)
    up, down = (se3.exp([0.0, 0.0, each, 0.0, 0.0, 0.0]) for each in (0.02, -0.02))
    lifted = [(up, Measurement(False)), (down, second[0][1])]
    identity = identified(shelf.catalogue, [*first, *lifted, *second[1:]])
    assert identity.answer == "bumpy_2"
    assert np.linalg.norm(identity.leading.hypotheses[0].pose[:3, 3] - truth[-1][:3, 3]) < 3e-3


def test_probabilities_are_one_together_from_the_beginning(shelf):
    identification = Identification(shelf.catalogue, replace(CONFIG, unknown_prior=0.4), NOISE)
    _, frames = shelf.touches(0, steps=40)
    for moved, touch in frames:
        found = identification.identity
        fractions = [each.probability for each in found.objects]
        assert sum(fractions) + found.unknown == pytest.approx(1.0)
        identification.step(moved, touch)
    identification.restart()
    assert [each.probability for each in identification.identity.objects] == pytest.approx([0.2] * 3)


def test_hypotheses_move_with_the_gel(shelf):
    identification = Identification(shelf.catalogue, CONFIG, NOISE)
    _, frames = shelf.touches(0)
    for moved, touch in frames:
        identification.step(moved, touch)
    before = identification.identity.leading.hypotheses[0].pose
    step = se3.exp([0.005, 0.0, 0.002, 0.0, 0.1, 0.0])  # a gap, no lift yet
    measured = identification.measured_gels
    assert len(measured) > 5
    identification.step(step, Measurement(False))
    assert np.allclose(identification.measured_gels, se3.inverse(step) @ measured)
    assert np.allclose(identification.identity.leading.hypotheses[0].pose, before @ step)


def test_the_same_touches_give_the_same_answer(shelf):
    _, frames = shelf.touches(0, steps=60)
    one, two = (identified(shelf.catalogue, frames) for _ in range(2))
    assert one.in_words() == two.in_words()
    assert one.unknown == two.unknown


def test_what_cannot_be_used_is_passed_over(shelf):
    _, frames = shelf.touches(0, steps=80)
    good = frames[0][1]
    bad = [
        (np.full((4, 4), np.nan), Measurement(False)),
        (None, replace(good, code=np.zeros(48))),
        (None, replace(good, penetration=np.full((80, 60), np.nan))),
        (None, replace(good, penetration=np.zeros((4, 4)))),
    ]
    with_bad = [each for frame in frames for each in (*bad, frame)]
    assert identified(shelf.catalogue, with_bad).answer == "bumpy_1"
    with pytest.raises(InputError, match="from network another"):
        Identification(shelf.catalogue, CONFIG, NOISE).step(None, Measurement(True, network_id="another"))


def test_maps_that_fit_one_after_the_other_speak_more_than_maps_that_pull_apart():
    hypothesis = PoseHypothesis(np.eye(4), np.eye(6), 0.0)
    residual_ratio, squared_innovation = np.full((2, 4), 0.1), np.array([4 * [1.0], 4 * [15.0]])
    contest = Contest(
        np.array([0, 1]), [hypothesis, hypothesis], residual_ratio, squared_innovation, np.ones(4), np.full(4, 1e-3)
    )
    (one, other), unknown = contest.posterior(NOISE, 2, 0.5)
    assert one > 5 * other
    assert one + other + unknown == pytest.approx(1.0)


def contest(owner, residual_ratio, touches):
    hypothesis = PoseHypothesis(np.eye(4), np.eye(6), 0.0)
    residual_ratio = np.tile(np.array(residual_ratio)[:, None], touches)
    return Contest(
        np.array(owner),
        [hypothesis] * len(owner),
        residual_ratio,
        0 * residual_ratio,
        np.ones(touches),
        np.full(touches, 1e-3),
    )


@pytest.mark.parametrize("owner", [[0], [0, 0, 0, 1]])
def test_touches_that_say_nothing_leave_the_probabilities_of_before_however_many_hypotheses_were_followed(owner):
    fractions, unknown = contest(owner, [NOISE.foreign_residual] * len(owner), 3).posterior(NOISE, 2, 0.4)
    assert np.bincount(owner, fractions)[0] == pytest.approx(0.3, abs=1e-3)
    assert unknown == pytest.approx(1 - 0.3 * len(set(owner)), abs=1e-3)


@pytest.mark.parametrize("unknown", [0.001, 0.01, 0.5, 0.999])
def test_the_prior_of_an_unknown_object_is_honoured_however_small(unknown):
    lifted = replace(contest([0, 0, 0, 1], [NOISE.foreign_residual] * 4, 32), change=np.full(32, 0.2))
    fractions, none = lifted.posterior(NOISE, 2, unknown)
    assert none == pytest.approx(unknown, abs=1e-3)
    assert np.bincount([0, 0, 0, 1], fractions) == pytest.approx([(1 - unknown) / 2] * 2, abs=1e-3)


def test_an_object_is_as_probable_as_its_best_hypothesis_whatever_else_was_followed_on_it():
    (one, _), alone = contest([0, 1], [0.1, 0.1], 4).posterior(NOISE, 2, 0.5)
    fractions, among_others = contest([0, 0, 0, 1], [0.1, 0.9, 0.1, 0.1], 4).posterior(NOISE, 2, 0.5)
    assert np.bincount([0, 0, 0, 1], fractions) == pytest.approx([one, one], rel=0.01)
    assert among_others == pytest.approx(alone, rel=0.01)
    assert fractions[0] == pytest.approx(fractions[2])
    assert fractions[1] < 0.05


def test_what_many_objects_explain_an_unknown_one_explains_as_well():
    one_alone, unknown = contest([0], [0.02], 6).posterior(NOISE, 10, 0.5)
    assert one_alone[0] > 0.99 > 0.01 > unknown
    five, unknown = contest([0, 1, 2, 3, 4], [0.02] * 5, 6).posterior(NOISE, 10, 0.5)
    assert unknown > five.max()
    assert five.sum() + unknown == pytest.approx(1.0)


def test_what_competes_is_said(shelf):
    words = Identification(shelf.catalogue, CONFIG, NOISE).identity.in_words()
    assert words == "unknown 50%, bumpy_1 17%, bumpy_2 17%, bumpy_3 17%"


@pytest.mark.parametrize("residual_ratio", [0.02, 0.44])
def test_a_single_object_competes_with_none_and_touches_that_it_explains_badly_speak_for_that(residual_ratio):
    ((own,), none) = contest([0], [residual_ratio], 12).posterior(NOISE, 1, 0.5)
    assert own + none == pytest.approx(1.0)
    assert (none < 0.01) if residual_ratio < 0.1 else (none > 0.95)
    for known in (None, 0.0):
        assert contest([0], [residual_ratio], 12).posterior(NOISE, 1, 0.0, known)[1] < 1e-9


def test_earlier_touches_and_the_last_ones_say_together_what_all_of_them_do():
    whole = contest([0], [0.3], 12)
    _, before = contest([0], [0.3], 8).posterior(NOISE, 1, 0.5)
    _, after = whole.of_last(4).posterior(NOISE, 1, 0.5, before)
    assert after == pytest.approx(whole.posterior(NOISE, 1, 0.5)[1], abs=0.01)
    assert 0.5 < before < after
