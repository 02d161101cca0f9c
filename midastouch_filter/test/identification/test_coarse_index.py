import numpy as np
import pytest

from midastouch_filter.identification.coarse_index import CoarseIndex, typical_codes


def codes_of(seed, count=2000, kinds=20, dim=16):
    """Codes of an object that measures like `kinds` different things."""
    rng = np.random.default_rng(seed)
    codes = rng.standard_normal((kinds, dim))[rng.integers(kinds, size=count)] + 0.1 * rng.standard_normal((count, dim))
    return (codes / np.linalg.norm(codes, axis=1, keepdims=True)).astype(np.float32)


def test_every_code_is_near_a_typical_one():
    codes = codes_of(0)
    typical = typical_codes(codes)
    assert len(typical) <= 128
    assert np.linalg.norm(typical, axis=1) == pytest.approx(1.0, abs=1e-5)
    assert (codes @ typical.T).max(axis=1).min() > 0.95
    assert np.array_equal(typical, typical_codes(codes))


def test_an_object_of_few_poses_has_as_many_typical_codes():
    assert len(typical_codes(codes_of(0, count=5, kinds=5))) == 5


def test_touches_speak_for_the_object_that_is_like_them():
    objects = [codes_of(seed) for seed in range(6)]
    index = CoarseIndex([typical_codes(codes) for codes in objects], temperature=0.06, outlier=0.04)
    for k, codes in enumerate(objects):
        log_ratios = index.log_ratios(codes[:50])
        assert log_ratios.shape == (6, 50)
        assert (log_ratios.argmax(axis=0) == k).mean() > 0.9
        assert log_ratios.min() == pytest.approx(np.log(0.04), abs=0.1)
        assert log_ratios.max() <= np.log(6)
