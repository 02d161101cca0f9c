import numpy as np
import pytest

from midastouch_filter.smoothing.window_likelihood import hypothesis_posterior

HYPOTHESES = 1000.0


def at(evidence, change):
    """Posterior of hypotheses as likely as any of `HYPOTHESES`, beforehand and after a broken motion."""
    prior = np.full(len(evidence), 1 / HYPOTHESES)
    likely = np.log(np.append(prior, 1 - prior.sum()))
    return hypothesis_posterior(np.array(evidence, float), likely, likely, change)


def posterior(evidence, change=1e-3):
    return at(evidence, np.full(len(evidence[0]), change))


def test_without_evidence_it_is_elsewhere():
    fraction, elsewhere = posterior([[0, 0], [0, 0]])
    assert fraction == pytest.approx([1 / HYPOTHESES] * 2, rel=0.01)
    assert elsewhere == pytest.approx(1 - 2 / HYPOTHESES)


def test_by_touches_alone_it_is_bayes_rule():
    fraction, elsewhere = posterior([[5, 6], [4, 5]], change=1e-12)
    odds = np.exp([11 - np.log(HYPOTHESES), 9 - np.log(HYPOTHESES), np.log(1 - 2 / HYPOTHESES)])
    assert [*fraction, elsewhere] == pytest.approx(odds / odds.sum(), rel=1e-6)


def test_a_touch_that_nothing_explains_decides_nothing():
    (before, _), (after, _) = posterior([[5, 6], [4, 5]]), posterior([[5, 6, -1], [4, 5, -1]])
    assert after[0] / after[1] == pytest.approx(before[0] / before[1], rel=0.05)


def test_a_hypothesis_is_left_after_as_many_touches_as_it_takes_to_find_another_one():
    for kept in (5, 50):  # however long the first hypothesis was right
        new = [[4] * kept + [-2] * 4, [-4] * kept + [5] * 4]
        assert posterior(new)[0].argmax() == 1


def test_after_a_lift_fewer_touches_are_enough():
    evidence = np.array([[4.0, 4, 4, -1.5, -1.5], [-4, -4, -4, 3, 3]])
    slid = np.full(5, 1e-3)
    lifted = np.where(np.arange(5) == 3, 0.2, slid)
    of_slid, _ = at(evidence, slid)
    of_lifted, _ = at(evidence, lifted)
    assert of_slid.argmax() == 0
    assert of_lifted.argmax() == 1
    assert of_lifted.sum() < 1


def test_many_hypotheses_and_loud_touches_stay_finite():
    rng = np.random.default_rng(0)
    evidence = 1e4 * rng.standard_normal((300, 20))
    fraction, elsewhere = posterior(evidence)
    assert fraction.sum() + elsewhere == pytest.approx(1)


def test_touches_that_say_nothing_leave_what_was_believed_however_often_it_is_lifted():
    likely = np.log([0.1, 0.2, 0.05, 0.65])
    fraction, elsewhere = hypothesis_posterior(np.zeros((3, 20)), likely, likely, np.full(20, 0.2))
    assert [*fraction, elsewhere] == pytest.approx(np.exp(likely))
