import numpy as np
import pytest
import trimesh

from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core.alignment import PenetrationAlignment
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.keyframes import Keyframe, WeighedWindow
from midastouch_filter.core.noise_model import Effort, NoiseModel
from midastouch_filter.core.pose_hypothesis import pose_distance
from midastouch_filter.core.touch import MAP_SCALE, Measurement
from midastouch_filter.smoothing.window_likelihood import (
    Alignments,
    Followed,
    Race,
    WindowLikelihood,
    hypothesis_posterior,
)
from midastouch_perception.sensor_model import SensorModel

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
    return se3.translation([x, 0.0, 0.0])


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


def test_an_alignment_that_a_wide_prior_does_not_exclude_is_known_too(keyframes):
    several = [followed([fit], [x]) for fit, x in ((0.5, 0.001), (0.9, 0.03), (0.99, 0.2))]
    known, narrow, wide = Alignments(several, keyframes[:1]), 1e-4 * np.eye(6), 1e-4 * np.eye(6)
    wide[0, 0] = 0.02**2
    np.testing.assert_array_equal(known.better(keyframes[0], 0.6, np.eye(4), wide, within=9.0), beside(0.03))
    assert known.better(keyframes[0], 0.6, np.eye(4), narrow, within=4.0) is None, "that one is too far off"
    assert known.better(keyframes[0], 0.95, np.eye(4), wide, within=9.0) is None, "that one explains no more"
    assert known.better(keyframes[1], 0.0, np.eye(4), wide, within=9.0) is None, "that keyframe is new"


def test_touches_of_a_plane_do_not_lose_the_corner_that_is_known(tmp_path):
    size, pressed = (0.08, 0.05, 0.028), 1e-3  # m
    trimesh.creation.box(size).export(tmp_path / "box.ply")
    noise = NoiseModel.of(FilterConfig(threads=1))
    sensor = SensorModel.load("digit_tacto").scaled(MAP_SCALE)
    alignment = PenetrationAlignment(ObjectMesh.load(tmp_path / "box.ply"), sensor, noise)
    # from a corner inwards
    at = [(0.038 - 0.01 * k, 0.022 - 0.006 * k, 0.3 + 0.1 * k) for k in range(4)]
    path = np.stack([beside(x) @ se3.exp(np.array([0, y, size[2] / 2 - pressed, 0, 0, turn])) for x, y, turn in at])
    window = [
        Keyframe(pose, [Measurement(True, penetration=each)], [], [], 0)
        for pose, each in zip(path, alignment.render(path), strict=True)
    ]
    weighed = WeighedWindow(window, np.ones(len(path)), np.full(len(path), 1e-3))

    def follow(start, known=None):
        likelihood = WindowLikelihood(weighed, alignment, noise, Effort(), 0.5, Race(weighed), known)
        list(likelihood.follow(start))
        return likelihood.followed[0]

    right = follow(path[-1])
    astray = path[-1] @ se3.exp(np.array([-7e-3, -0.7e-3, 0, 0, 0, np.radians(-12.5)]))
    assert pose_distance(follow(astray).pose, path[0]) > 0.01, "a start that one descent loses"
    assert pose_distance(follow(astray, Alignments([right], window)).pose, path[0]) < 0.001
