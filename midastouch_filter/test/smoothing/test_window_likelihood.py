import numpy as np
import pytest

from midastouch_common import se3
from midastouch_filter.core.keyframes import Keyframe
from midastouch_filter.smoothing.window_likelihood import Alignments, Followed, hypothesis_posterior

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


def beside(x):
    """A pose (4, 4) so far along x [m]."""
    return se3.make(np.eye(3), np.array([x, 0.0, 0.0]))


def followed(fits, xs, at=0):
    """A hypothesis that explained these parts of the maps of each keyframe, aligned so far along x [m]."""
    poses = np.stack([beside(x) for x in xs])
    return Followed(poses[-1], np.eye(6), at, 1.0 - np.array(fits), poses, np.tile(np.eye(6), (len(xs), 1, 1)), poses)


@pytest.fixture
def keyframes():
    return [Keyframe(np.eye(4), [], [], [], 0) for _ in range(3)]


def test_an_alignment_is_found_again_at_its_own_keyframe_only(keyframes):
    known = Alignments([followed([0.7, 0.8], [0.0, 0.05])], keyframes[:2])
    fit, pose = known.near(keyframes[0], beside(0.003))
    assert fit == pytest.approx(0.7)
    np.testing.assert_array_equal(pose, np.eye(4))
    assert known.near(keyframes[1], beside(0.003)) is None, "there it was elsewhere"
    assert known.near(keyframes[2], beside(0.003)) is None, "that one is new"
    assert Alignments().near(keyframes[0], np.eye(4)) is None


def test_only_alignments_near_by_count_and_of_these_the_one_that_explained_most(keyframes):
    several = [followed([fit], [x]) for fit, x in ((0.5, 0.001), (0.8, 0.006), (0.99, 0.02))]
    fit, pose = Alignments(several, keyframes[:1]).near(keyframes[0], np.eye(4))
    assert fit == pytest.approx(0.8)
    np.testing.assert_array_equal(pose, beside(0.006))


def test_keyframes_that_a_hypothesis_was_not_followed_to_know_nothing_of_it(keyframes):
    known = Alignments([followed([0.0, 0.9], [0.0, 0.0], at=1)], keyframes[:2])
    assert known.near(keyframes[0], np.eye(4)) is None
    assert known.near(keyframes[1], np.eye(4)) is not None
