import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.stats import chi2, norm

from midastouch_filter.core import resampling
from midastouch_filter.core.config import FilterConfig

weights = arrays(float, st.integers(1, 200), elements=st.floats(0, 1e3, allow_subnormal=False)).filter(
    lambda w: w.sum() > 1e-200
)


@given(weights, st.integers(1, 500), st.integers(0, 2**32))
def test_each_particle_is_drawn_its_part_of_times(w, n, seed):
    ancestors = resampling.systematic(w, n, np.random.default_rng(seed))
    drawn = np.bincount(ancestors, minlength=len(w))
    fraction = n * w / w.sum()
    assert len(ancestors) == n
    assert (np.diff(ancestors) >= 0).all()
    assert (drawn[w == 0] == 0).all()
    # the sums round at limits that fall exactly on a draw, hence one draw of slack
    assert (drawn >= np.floor(fraction) - 1).all()
    assert (drawn <= np.ceil(fraction) + 1).all()


def test_expectation_is_unbiased():
    w = np.array([0.5, 0.0, 0.3, 0.2])
    rng = np.random.default_rng(0)
    drawn = sum(np.bincount(resampling.systematic(w, 7, rng), minlength=4) for _ in range(4000)) / 4000
    np.testing.assert_allclose(drawn, 7 * w, atol=0.03)


@given(arrays(float, st.integers(1, 50), elements=st.floats(-1e5, 700)))
def test_log_sum_exp_agrees_with_pairwise_sums(values):
    assert resampling.log_sum_exp(values) == pytest.approx(np.logaddexp.reduce(values), rel=1e-9, abs=1e-9)


def test_log_sum_exp_of_nothing_but_impossible_is_impossible():
    assert resampling.log_sum_exp(np.full(5, -np.inf)) == -np.inf
    assert np.isnan(resampling.log_sum_exp(np.array([0.0, np.nan])))


@given(weights)
def test_effective_size_is_between_one_and_n(w):
    w = w / w.max()
    size = resampling.effective_size(w / w.sum())
    assert 1 - 1e-9 <= size <= len(w) * (1 + 1e-9)


@given(st.integers(1, 100_000), st.floats(0.01, 0.5), st.floats(0, 5))
def test_grows_with_bins_and_confidence_and_shrinks_with_allowed_error(bins, error, quantile):
    size = resampling.sample_size(bins, error, quantile)
    assert size >= 1
    assert resampling.sample_size(bins + 1, error, quantile) >= size
    assert resampling.sample_size(bins, error, quantile + 0.5) >= size
    assert resampling.sample_size(bins, 2 * error, quantile) <= size


@pytest.mark.parametrize("probability", [0.84, 0.95, 0.99])
@pytest.mark.parametrize("bins", [5, 50, 5000])
def test_takes_the_quantile_not_the_probability(bins, probability):
    exact = chi2.ppf(probability, bins - 1) / (2 * 0.05)
    assert resampling.sample_size(bins, 0.05, norm.ppf(probability)) == pytest.approx(exact, rel=0.02)


def test_count_stays_between_the_configured_limits():
    config = FilterConfig(min_particles=100, max_particles=2000)
    assert resampling.adapted_count(1, config) == 100
    assert resampling.adapted_count(500, config) == 2000
    assert 100 < resampling.adapted_count(40, config) < 2000
