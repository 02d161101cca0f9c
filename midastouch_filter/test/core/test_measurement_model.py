import numpy as np
import pytest

from midastouch_common.errors import InputError
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.measurement_model import MeasurementModel, log_ratios
from midastouch_filter.core.workers import Workers

WORKERS = Workers(1)


def model(world, **config):
    return MeasurementModel(world.codebook.codes, world.codebook.meta, FilterConfig(**config), WORKERS)


def test_is_the_stated_log_likelihood_ratio(world):
    m = model(world, temperature=0.2, outlier=0.1)
    code = world.codebook.codes[42]
    likelihood = np.exp(world.codebook.codes.astype(float) @ code.astype(float) / 0.2)
    (ratio,) = log_ratios([m], code)
    np.testing.assert_allclose(ratio, np.log(0.9 * likelihood / likelihood.mean() + 0.1), atol=1e-4)


def test_averages_to_a_certain_event_over_all_objects(world):
    meta = world.codebook.meta
    parts = [MeasurementModel(world.codebook.codes[rows], meta, FilterConfig(), WORKERS)
             for rows in (slice(0, 500), slice(500, None))]  # fmt: skip
    code = world.codebook.codes[7]
    ratios = log_ratios(parts, code)
    assert np.exp(np.concatenate(ratios).astype(float)).mean() == pytest.approx(1.0, abs=1e-4)
    np.testing.assert_allclose(np.concatenate(ratios), log_ratios([model(world)], code)[0], atol=1e-5)
    assert min(each.min() for each in ratios) >= np.log(parts[0].outlier) - 1e-5


@pytest.mark.parametrize("temperature", [1e-3, 0.05, 10.0])
def test_no_temperature_overflows(world, temperature):
    (ratio,) = log_ratios([model(world, temperature=temperature)], -world.codebook.codes[3])
    assert np.isfinite(ratio).all()


def test_codes_that_would_be_measured_are_scored_by_a_sample(world):
    m, codes = model(world), world.codebook.codes[:20]
    expected = np.stack([log_ratios([m], code)[0][:50] for code in codes])
    found = m.log_ratio_between(codes, m.similarity(codes @ world.codebook.codes[:50].T))
    assert min(np.corrcoef(a, b)[0, 1] for a, b in zip(found, expected, strict=True)) > 0.95


def test_refuses_a_book_without_calibration_or_with_nan(world):
    codes, meta = world.codebook.codes, world.codebook.meta
    with pytest.raises(InputError, match="temperature"):
        MeasurementModel(codes, meta | {"temperature": 0.0}, FilterConfig(), WORKERS)
    with pytest.raises(InputError, match="build-codebook"):
        MeasurementModel(np.full_like(codes, np.nan), meta, FilterConfig(), WORKERS)
