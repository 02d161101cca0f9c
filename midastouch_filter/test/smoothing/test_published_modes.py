"""What is published: the hypotheses of a comparison. Three poses lie far apart on a bumpy object."""

import numpy as np
import pytest

from midastouch_common import se3
from midastouch_filter.core.belief import Belief
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.noise_model import NoiseModel
from midastouch_filter.core.object_model import ObjectModel
from midastouch_filter.core.particles import Particles
from midastouch_filter.core.pose_hypothesis import PoseHypothesis
from midastouch_filter.core.state import AMBIGUOUS, CONVERGED, SEARCHING
from midastouch_filter.core.touch import Measurement
from midastouch_filter.core.workers import Workers
from midastouch_filter.smoothing.contest import Contest
from midastouch_filter.smoothing.published_modes import published_modes
from midastouch_filter.smoothing.reevaluation import Comparison
from midastouch_perception.symmetry.group import Symmetry

CONFIG = FilterConfig(threads=1)
NOISE = NoiseModel.of(CONFIG)
AT_REST = np.eye(4)
HALF_TURN = se3.make(np.diag([-1.0, -1.0, 1.0]), np.zeros(3))
KNOWN_TO = np.diag([1.0, 2.0, 3.0, 40.0, 50.0, 60.0]) * 1e-7  # of each hypothesis, in its own frame
NO_CONTEST = Contest(np.zeros(0, int), [], np.zeros((0, 0)), np.zeros((0, 0)), np.zeros(0), np.zeros(0))


@pytest.fixture(scope="module")
def model(world):
    return ObjectModel(world.mesh, world.codebook, CONFIG, NOISE, Workers(1))


@pytest.fixture(scope="module")
def places(world):
    """Contact poses (3, 4, 4)."""
    points = np.array([[0.04, 0.0, 0.02], [-0.04, 0.01, 0.02], [0.0, -0.03, -0.02]])
    return world.poses_at(world.mesh, points, np.zeros(3), 1e-3)


@pytest.fixture
def believed(model):
    """believed(weights by pose): 400 particles within half a millimetre of each pose (4, 4), or `within` [m]."""

    def make(*weighed, within=2e-4, symmetry=None) -> Belief:
        rng = np.random.default_rng(0)
        poses = [pose @ se3.exp(rng.normal(scale=[within] * 3 + [0.01] * 3, size=(400, 6))) for _, pose in weighed]
        particles = Particles.from_poses(np.concatenate(poses), model.lookup.exact(np.concatenate(poses)))
        particles.log_weights = np.log(np.repeat([weight / 400 for weight, _ in weighed], 400))
        belief = Belief(particles, model.lookup, model.mode_finder, symmetry or Symmetry())
        belief.cluster()
        return belief

    return make


def compared(*weighed, symmetry=None) -> Comparison:
    """A comparison that gave these probabilities to these poses (4, 4)."""
    hypotheses = [PoseHypothesis(pose, KNOWN_TO, probability) for probability, pose in weighed]
    elsewhere = 1.0 - sum(each.probability for each in hypotheses)
    nowhere = np.empty((0, 4, 4)), np.empty(0)
    return Comparison(hypotheses, elsewhere, NO_CONTEST, 0.0, True, *nowhere, symmetry or Symmetry())


def apart(a, b) -> float:
    """Distance [m] of two poses' origins."""
    return float(np.linalg.norm(a[:3, 3] - b[:3, 3]))


def test_the_weights_are_those_of_the_comparison(believed, places):
    here, there, _ = places
    found = published_modes(
        compared((0.9, here), (0.08, there)), AT_REST, 1.0, believed((0.5, there), (0.5, here)), CONFIG
    )
    assert [mode.weight for mode in found.modes] == pytest.approx([0.9, 0.08])
    assert [mode.n for mode in found.modes] == [400, 400]
    assert apart(found.modes[0].pose, here) < 1e-4
    assert found.listed == pytest.approx(0.98)


def test_what_is_hardly_possible_is_not_published(believed, places):
    here, there, _ = places
    comparison = compared((0.995, here), (0.5 * CONFIG.min_mode_mass, there))
    found = published_modes(comparison, AT_REST, 1.0, believed((1.0, here)), CONFIG)
    assert [mode.weight for mode in found.modes] == pytest.approx([0.995])


def test_a_hypothesis_without_particles_is_where_the_odometry_takes_it(believed, places):
    here, there, _ = places
    moved = se3.exp([0.01, -0.005, 0.0, 0.0, 0.0, 0.3])
    comparison = compared((0.6, there), (0.4, here))
    found = published_modes(comparison, moved, 1.0, believed((1.0, here @ moved)), CONFIG)
    alone, followed = found.modes
    np.testing.assert_allclose(alone.pose, there @ moved, atol=1e-12)
    assert (alone.weight, alone.n) == (pytest.approx(0.6), 0)
    assert (followed.weight, followed.n) == (pytest.approx(0.4), 400)
    assert found.listed == pytest.approx(1.0)


def test_a_hypothesis_without_particles_has_its_covariance_about_the_axes_of_the_object(believed, places):
    here, there, _ = places
    _, alone = published_modes(compared((0.6, here), (0.4, there)), AT_REST, 1.0, believed((1.0, here)), CONFIG).modes
    turn = there[:3, :3]
    np.testing.assert_allclose(turn.T @ alone.covariance[:3, :3] @ turn, KNOWN_TO[:3, :3], atol=1e-15)
    np.testing.assert_allclose(turn.T @ alone.covariance[3:, 3:] @ turn, KNOWN_TO[3:, 3:], atol=1e-15)


def test_the_particles_say_where_a_hypothesis_is_that_they_follow(believed, places):
    here = places[0]
    belief = believed((1.0, here @ se3.exp([0.003, 0.002, 0, 0, 0, 0.05])))
    (mode,) = published_modes(compared((1.0, here)), AT_REST, 1.0, belief, CONFIG).modes
    np.testing.assert_array_equal(mode.pose, belief.answers[0].pose)
    np.testing.assert_array_equal(mode.covariance, belief.answers[0].covariance)


@pytest.mark.parametrize(("beside", "within"), [(0.009, 2e-4), (0.0, 6e-3)], ids=["too far", "too wide"])
def test_particles_that_follow_no_hypothesis_do_not_say_where_it_is(believed, places, beside, within):
    here = places[0]
    belief = believed((1.0, here @ se3.exp([beside, 0, 0, 0, 0, 0])), within=within)
    (mode,) = published_modes(compared((0.9, here)), AT_REST, 1.0, belief, CONFIG).modes  # nor are they another answer
    assert (mode.n, mode.weight) == (0, pytest.approx(0.9))
    np.testing.assert_array_equal(mode.pose, here)


def test_a_mode_gives_its_pose_to_one_hypothesis_only(believed, places):
    here = places[0]
    two = compared((0.7, here), (0.3, here @ se3.exp([0.006, 0, 0, 0, 0, 0])))
    found = published_modes(two, AT_REST, 1.0, believed((1.0, here @ se3.exp([0.002, 0, 0, 0, 0, 0]))), CONFIG)
    assert [mode.n for mode in found.modes] == [400, 0]


def test_what_the_comparison_leaves_goes_to_particles_that_lie_elsewhere(believed, places):
    here, there, yonder = places
    belief = believed((0.2, here), (0.6, there), (0.2, yonder))
    found = published_modes(compared((0.6, here)), AT_REST, 1.0, belief, CONFIG)
    assert [mode.weight for mode in found.modes] == pytest.approx([0.6, 0.3, 0.1])
    assert apart(found.modes[1].pose, there) < 1e-4
    assert found.listed == pytest.approx(0.6), "of that it knows nothing"


def test_where_nothing_is_possible_the_particles_are_published(believed, places):
    found = published_modes(compared((1e-6, places[0])), AT_REST, 1.0, believed((1.0, places[1])), CONFIG)
    assert [mode.weight for mode in found.modes] == pytest.approx([1.0])
    assert found.listed == 0.0


def test_by_as_much_as_the_object_may_have_been_moved_the_modes_weigh_less(believed, places):
    here, there, _ = places
    comparison, belief = compared((0.9, here), (0.1, there)), believed((0.9, here), (0.1, there))
    found = published_modes(comparison, AT_REST, 0.8, belief, CONFIG)
    assert [mode.weight for mode in found.modes] == pytest.approx([0.72, 0.08])
    assert found.listed == pytest.approx(0.8)


def test_the_covariance_covers_the_distance_between_two_modes(believed, places):
    here, there, _ = places
    comparison, belief = compared((0.7, here), (0.3, there)), believed((0.7, here), (0.3, there))
    found = published_modes(comparison, AT_REST, 1.0, belief, CONFIG)
    first, second = found.modes
    offset = second.pose[:3, 3] - first.pose[:3, 3]
    within = 0.7 * first.covariance + 0.3 * second.covariance
    np.testing.assert_allclose(found.covariance[:3, :3], within[:3, :3] + 0.3 * np.outer(offset, offset), rtol=1e-9)
    angle = se3.rotation_angle(first.pose[:3, :3].T @ second.pose[:3, :3])
    assert np.trace(found.covariance[3:, 3:]) == pytest.approx(np.trace(within[3:, 3:]) + 0.3 * angle**2)


def test_the_covariance_of_one_mode_is_its_own(believed, places):
    found = published_modes(compared((0.9999, places[0])), AT_REST, 1.0, believed((1.0, places[0])), CONFIG)
    np.testing.assert_allclose(found.covariance, found.modes[0].covariance, rtol=1e-9)


def test_particles_of_no_mode_widen_the_covariance_by_what_is_left(believed, places, model):
    here = places[0]
    scattered = [(1e-3, pose) for pose in model.lookup.poses[:300]]
    belief = believed((0.7, here), *scattered, within=1e-5)
    found = published_modes(compared((0.7, here)), AT_REST, 1.0, belief, CONFIG)
    distance = np.mean([apart(pose, here) ** 2 for _, pose in scattered])
    assert 0.05 * distance < np.trace(found.covariance[:3, :3]) < 0.35 * distance


def test_modulo_symmetry_particles_at_a_copy_follow_the_hypothesis(believed, places):
    here, there, _ = places
    twofold = Symmetry(np.stack([np.eye(4), HALF_TURN]))
    belief = believed((1.0, HALF_TURN @ here), symmetry=twofold)
    found = published_modes(compared((0.8, here), (0.2, there), symmetry=twofold), AT_REST, 1.0, belief, CONFIG)
    assert [mode.n for mode in found.modes] == [400, 0], "a copy is no mode of its own"
    assert apart(found.modes[0].pose, HALF_TURN @ here) < 1e-4
    assert [mode.weight for mode in found.modes] == pytest.approx([0.8, 0.2])


def test_the_filter_publishes_what_it_compared_until_it_is_lifted(mapped_slide):
    running = mapped_slide.make_filter()
    assert running.modes == []
    running.initialise_gaussian(mapped_slide.poses[0], 0.03, 0.3)
    first = running.step(mapped_slide.odometry[0], mapped_slide.touches[0])
    assert first.status.state == SEARCHING, "nothing was compared yet"
    for motion, touch in zip(mapped_slide.odometry[1:60], mapped_slide.touches[1:60], strict=True):
        before = running.step(motion, touch)
        assert before.status.n_modes == len(before.modes)
        assert before.status.mode_mass == before.modes[0].weight
        if before.status.state == AMBIGUOUS:
            assert sum(mode.weight for mode in before.modes) > 0.89
    assert before.status.state == CONVERGED
    np.testing.assert_array_equal([mode.pose for mode in running.modes], [mode.pose for mode in before.modes])
    up = se3.translation([0.0, 0.0, -0.03])
    running.step(up, Measurement(False))
    after = running.step(se3.inverse(up), mapped_slide.touches[59])
    assert after.status.state == SEARCHING
    assert after.modes[0].weight == pytest.approx((1 - NOISE.change_lifted) * before.modes[0].weight, abs=0.01)
