import numpy as np
import pytest

from midastouch_benchmark.fits.slope_weight import best_weight


def test_the_mean_of_two_estimates_errs_least_with_the_weight():
    rng = np.random.default_rng(0)
    common, own = rng.standard_normal(100_000), rng.standard_normal((2, 100_000))
    errors = common + np.array([[1.0], [2.0]]) * own
    weight = best_weight(errors)
    assert weight == pytest.approx(0.2, abs=0.01)  # of variances 1 and 4, what both err by aside
    spread = [np.var((1 - w) * errors[0] + w * errors[1]) for w in (weight - 0.05, weight, weight + 0.05)]
    assert spread[1] == min(spread)
