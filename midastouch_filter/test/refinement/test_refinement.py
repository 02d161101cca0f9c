import numpy as np
import pytest

from midastouch_common import se3
from midastouch_filter.core.alignment import Aligned, PenetrationAlignment
from midastouch_filter.core.belief import sharpened
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.estimate import Mode
from midastouch_filter.core.noise_model import Effort, NoiseModel
from midastouch_filter.core.particles import Particles
from midastouch_filter.core.touch import MAP_SCALE, Measurement, reduced_penetration
from midastouch_filter.core.workers import Workers
from midastouch_filter.refinement.refinement import Refinement
from midastouch_perception.rendering.contact_poses import ContactSampling, sample_contact_poses
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_model import SensorModel

CONFIG = FilterConfig()
NOISE = NoiseModel.of(CONFIG)
SIGMA = np.array([2e-3, 2e-3, 5e-4, 0.03, 0.03, 0.06])


@pytest.fixture(scope="module")
def sensor():
    return SensorModel.load("digit_tacto")


@pytest.fixture(scope="module")
def touch(tool, sensor):
    """A pose on the tool's edge and what is measured there, and another pose far away."""
    sampling = ContactSampling(press=(8e-4, 1e-3), edge_fraction=1.0, free_fraction=0.0)
    poses = sample_contact_poses(tool, 2, np.random.default_rng(4), sensor, sampling)
    return poses[0], reduced_penetration(PenetrationRenderer(tool, sensor.scaled(0.5)).render(poses[:1])[0]), poses[1]


def make_refinement(alignment):
    return Refinement(alignment, CONFIG, NOISE, Effort(), Workers(2))


@pytest.fixture
def refinement(tool, sensor):
    return make_refinement(PenetrationAlignment(tool, sensor.scaled(MAP_SCALE), NOISE))


def cloud(pose, n, rng, sigma=SIGMA):
    poses = pose @ se3.exp(rng.standard_normal((n, 6)) * sigma)
    return Particles.from_poses(poses, np.zeros(n, int))


def mode_of(pose, n, weight=1.0, sigma=SIGMA):
    turn = np.kron(np.eye(2), pose[:3, :3])
    return Mode(weight, pose, turn @ np.diag(sigma**2) @ turn.T, n)


def test_reduced_penetration_is_the_block_mean():
    penetration = np.arange(160 * 120, dtype=np.float32).reshape(160, 120)
    reduced = reduced_penetration(penetration)
    assert reduced.shape == (80, 60)
    assert reduced[3, 5] == penetration[6:8, 10:12].mean()


def test_a_narrow_mode_moves_to_what_is_measured(refinement, touch):
    truth, penetration, _ = touch
    start = truth @ se3.exp(np.array([1.5e-3, -1e-3, 4e-4, 0.02, -0.02, 0.03]))
    particles = cloud(start, 400, np.random.default_rng(0))
    aligned = refinement.apply(
        particles, np.zeros(400, np.int32), [mode_of(start, 400)], [Measurement(True, penetration=penetration)]
    )
    assert aligned[0].fit > 0.9
    before = np.linalg.norm(start[:3, 3] - truth[:3, 3])
    after = np.linalg.norm(particles.positions.mean(axis=0) - truth[:3, 3])
    assert after < 0.7 * before
    spread = np.linalg.norm(particles.positions.std(axis=0))
    assert spread < 0.9 * np.linalg.norm(SIGMA[:3])
    np.testing.assert_allclose(np.linalg.norm(particles.quaternions, axis=1), 1, atol=1e-5)
    # the frame's own pose is nearer still, because the jitter is part of it
    assert np.linalg.norm(aligned[0].pose[:3, 3] - truth[:3, 3]) < 0.5 * before
    np.testing.assert_array_equal(sharpened(mode_of(start, 400), aligned[0], 1.0).pose, aligned[0].pose)


def test_particles_of_one_frame_are_where_it_has_the_mode(refinement, touch):
    """The copy has the aligned pose and covariance; the particles themselves, and those of no mode, stay."""
    truth, sigma = touch[0], 0.1 * SIGMA
    particles = cloud(truth, 4000, np.random.default_rng(5))
    before = particles.poses
    members = np.repeat(np.array([0, -1], np.int32), 2000)
    pose = truth @ se3.exp(np.array([5e-4, 2e-4, -1e-4, 0.01, 0.02, -0.01]))
    shown = refinement.sharpened(
        particles, members, [mode_of(truth, 2000)], {0: Aligned(pose, np.diag(sigma**2), 0.0, 1.0)}
    )
    deviation = se3.log(se3.inverse(pose) @ shown.poses[:2000])
    np.testing.assert_allclose(deviation.mean(axis=0) / sigma, 0, atol=0.1)
    np.testing.assert_allclose(deviation.std(axis=0) / sigma, 1, atol=0.1)
    np.testing.assert_array_equal(shown.poses[2000:], before[2000:])
    np.testing.assert_array_equal(particles.poses, before)


def test_wide_modes_are_left_alone(refinement, touch):
    truth, penetration, _ = touch
    particles = cloud(truth, 50, np.random.default_rng(0), 10 * SIGMA)
    before = particles.positions.copy()
    wide = mode_of(truth, 50, sigma=10 * SIGMA)
    assert (
        refinement.apply(particles, np.zeros(50, np.int32), [wide], [Measurement(True, penetration=penetration)]) == {}
    )
    np.testing.assert_array_equal(particles.positions, before)


def test_mass_moves_to_the_mode_that_fits(refinement, touch):
    truth, penetration, elsewhere = touch
    rng = np.random.default_rng(1)
    right, wrong = cloud(truth, 200, rng), cloud(elsewhere, 200, rng)
    particles = Particles(
        np.concatenate([right.positions, wrong.positions]),
        np.concatenate([right.quaternions, wrong.quaternions]),
        np.full(400, -np.log(400)),
        np.zeros(400, np.int32),
    )
    members = np.repeat(np.array([1, 0], np.int32), 200)
    modes = [mode_of(elsewhere, 200, 0.5), mode_of(truth, 200, 0.5)]
    aligned = refinement.apply(particles, members, modes, [Measurement(True, penetration=penetration)])
    mass = 0.5 * np.exp(refinement.gains(modes, aligned, 0.5))
    assert mass.sum() == pytest.approx(1)
    most = np.ptp(NoiseModel.of(FilterConfig()).residual_evidence(np.array([0.0, 1.0])))  # here of half a touch
    assert 0.8 < mass[1] <= 1 / (1 + np.exp(-0.5 * most)) + 1e-9


def test_the_mass_of_modes_that_are_not_aligned_stays(refinement, touch):
    modes = [mode_of(touch[0], 200, weight) for weight in (0.5, 0.3, 0.2)]
    fits = {0: 0.9, 2: 0.1}
    aligned = {k: Aligned(touch[0], np.eye(6), 0.0, fit) for k, fit in fits.items()}
    gains = refinement.gains(modes, aligned, 1.0)
    assert gains[1] == 0
    assert gains[0] > 0 > gains[2]
    assert np.dot([0.5, 0.3, 0.2], np.exp(gains)) == pytest.approx(1)
    assert not refinement.gains(modes, {2: aligned[2]}, 1.0).any(), "one alone keeps its mass"


class TwoOptima:
    """Stands for an alignment that ends 5 mm to the left or right of the prior, whichever side it starts on."""

    def __init__(self, left_is_worse_by: float, fit: float = 0.9):
        self._worse, self._fit = left_is_worse_by, fit
        self.starts = 0

    def align(self, pose, covariance, penetration, start):
        self.starts += 1
        left = (se3.inverse(pose) @ start)[0, 3] < 0
        end = pose @ se3.translation([-5e-3 if left else 5e-3, 0, 0])
        return Aligned(end, 1e-8 * np.eye(6), -self._worse if left else 0.0, self._fit)


def wide_mode(touch, spread=6e-3):
    sigma = np.array([spread, 1e-3, 1e-4, 1e-2, 1e-2, 1e-2])
    particles = cloud(touch[0], 200, np.random.default_rng(3), sigma)
    return particles, mode_of(touch[0], 200, sigma=sigma)


@pytest.mark.parametrize(("nats", "agreed"), [(1.0, False), (10.0, True)])
def test_a_wide_mode_moves_only_if_one_of_its_hypotheses_is_clearly_best(touch, nats, agreed):
    particles, mode, optima = *wide_mode(touch), TwoOptima(nats)
    before = particles.positions.copy()
    aligned = make_refinement(optima).apply(
        particles, np.zeros(200, np.int32), [mode], [Measurement(True, penetration=touch[1])]
    )
    assert optima.starts > 2
    assert bool(aligned) == agreed
    if agreed:
        np.testing.assert_allclose(aligned[0].pose[:3, 3], (mode.pose @ [5e-3, 0, 0, 1])[:3], atol=1e-6)
    else:
        np.testing.assert_array_equal(particles.positions, before)


def test_a_narrow_mode_is_aligned_from_its_mean_alone(touch):
    particles, mode, optima = *wide_mode(touch, spread=1e-3), TwoOptima(1.0)
    assert make_refinement(optima).apply(
        particles, np.zeros(200, np.int32), [mode], [Measurement(True, penetration=touch[1])]
    )
    assert optima.starts == 1


def test_hypotheses_that_measure_nothing_of_it_move_nothing(touch):
    particles, mode, optima = *wide_mode(touch), TwoOptima(1.0, fit=0.1)
    before = particles.positions.copy()
    assert (
        make_refinement(optima)
        .apply(particles, np.zeros(200, np.int32), [mode], [Measurement(True, penetration=touch[1])])[0]
        .fit
        == 0.1
    )
    np.testing.assert_array_equal(particles.positions, before)
