import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chi2, norm

from midastouch_filter.core import kld
from midastouch_filter.core.config import FilterConfig


@given(st.integers(1, 100_000), st.floats(0.01, 0.5), st.floats(0, 5))
def test_grows_with_bins_and_confidence_and_shrinks_with_allowed_error(bins, error, quantile):
    size = kld.sample_size(bins, error, quantile)
    assert size >= 1
    assert kld.sample_size(bins + 1, error, quantile) >= size
    assert kld.sample_size(bins, error, quantile + 0.5) >= size
    assert kld.sample_size(bins, 2 * error, quantile) <= size


@pytest.mark.parametrize("probability", [0.84, 0.95, 0.99])
@pytest.mark.parametrize("bins", [5, 50, 5000])
def test_takes_the_quantile_not_the_probability(bins, probability):
    exact = chi2.ppf(probability, bins - 1) / (2 * 0.05)
    assert kld.sample_size(bins, 0.05, norm.ppf(probability)) == pytest.approx(exact, rel=0.02)


def test_count_stays_between_the_configured_limits():
    config = FilterConfig(min_particles=100, max_particles=2000)
    assert kld.adapted_count(1, config) == 100
    assert kld.adapted_count(500, config) == 2000
    assert 100 < kld.adapted_count(40, config) < 2000
