import numpy as np
import pytest

from midastouch_common.errors import InputError
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.measurement_model import MeasurementModel
from midastouch_filter.core.particles import Particles
from midastouch_filter.core.workers import Workers

WORKERS = Workers(1)


def model(world, **config):
    return MeasurementModel(world.codebook.codes, world.codebook.meta, FilterConfig(**config), WORKERS)


def test_is_the_stated_log_likelihood_ratio(world):
    m = model(world, temperature=0.2, outlier=0.1)
    code = world.codebook.codes[42]
    m.score_codebook(code)
    likelihood = np.exp(world.codebook.codes.astype(float) @ code.astype(float) / 0.2)
    np.testing.assert_allclose(m.log_ratio, np.log(0.9 * likelihood / likelihood.mean() + 0.1), atol=1e-4)


def test_averages_to_a_certain_event_over_the_book(world):
    m = model(world)
    m.score_codebook(world.codebook.codes[7])
    assert np.exp(m.log_ratio.astype(float)).mean() == pytest.approx(1.0, abs=1e-4)
    assert m.log_ratio.min() >= np.log(m.outlier) - 1e-5


def test_another_sensor_has_scores_of_its_own(world):
    m = model(world)
    m.score_codebook(world.codebook.codes[7])
    before = m.log_ratio.copy()
    other = m.for_another_sensor()
    other.score_codebook(world.codebook.codes[8])
    np.testing.assert_array_equal(m.log_ratio, before)
    m.score_codebook(world.codebook.codes[8])
    np.testing.assert_array_equal(m.log_ratio, other.log_ratio)


@pytest.mark.parametrize("temperature", [1e-3, 0.05, 10.0])
def test_no_temperature_overflows(world, temperature):
    m = model(world, temperature=temperature)
    m.score_codebook(-world.codebook.codes[3])
    assert np.isfinite(m.log_ratio).all()


def test_scoring_occupied_entries_gives_what_the_whole_book_gives(world):
    rng = np.random.default_rng(0)
    near = np.argsort(np.linalg.norm(world.poses[:, :3, 3] - world.poses[5, :3, 3], axis=1))[:300]
    entries = rng.choice(near, 400)
    particles = Particles.from_poses(world.poses[entries], entries)
    m = model(world)
    code = world.codebook.codes[5]
    m.score_codebook(code)
    whole = m.log_likelihood(particles).copy()
    m.log_ratio[:] = np.nan
    m.score_occupied(code, particles)
    # the sampled mean of the book is off by some per cent, the same for every particle
    np.testing.assert_allclose(m.log_likelihood(particles), whole, atol=0.25)
    strong = whole > 0
    assert np.ptp((m.log_likelihood(particles) - whole)[strong]) < 0.02


def test_draws_the_best_matches_by_their_likelihood(world):
    m = model(world)
    m.score_codebook(world.codebook.codes[11])
    drawn = m.draw_matches(4000, np.random.default_rng(0))
    fraction = np.exp(m.log_ratio.astype(float))
    best = np.argsort(-fraction)[:50]
    expected = fraction[best].sum() / fraction.sum()
    assert np.isin(drawn, best).mean() == pytest.approx(expected, abs=0.03)


@pytest.mark.parametrize(
    ("code", "complaint"),
    [
        (None, "no code"),
        (np.ones(3), "length 3 instead of 64"),
        (np.zeros(64), "zero"),
        (np.full(64, np.nan), "finite"),
        (np.full(64, np.inf), "finite"),
    ],
)
def test_says_why_a_code_cannot_be_used(world, code, complaint):
    with pytest.raises(ValueError, match=complaint):
        model(world).unit_code(code)


@pytest.mark.parametrize("scale", [1e-3, 1e30])
def test_length_of_the_code_does_not_matter(world, scale):
    code = model(world).unit_code(world.codebook.codes[0] * scale)
    np.testing.assert_allclose(code, world.codebook.codes[0], atol=1e-5)


def test_refuses_a_book_without_calibration_or_with_nan(world):
    codes, meta = world.codebook.codes, world.codebook.meta
    with pytest.raises(InputError, match="temperature"):
        MeasurementModel(codes, meta | {"temperature": 0.0}, FilterConfig(), WORKERS)
    with pytest.raises(InputError, match="build-codebook"):
        MeasurementModel(np.full_like(codes, np.nan), meta, FilterConfig(), WORKERS)
