import numpy as np
import pytest

from midastouch_benchmark.statistics.paired import error_ratio
from midastouch_common.errors import InputError


def trials(errors: np.ndarray) -> list[dict]:
    """errors (objects, slides, seeds) mm."""
    return [
        {"object": f"o{i}", "slide": j, "init": "paper", "seed": k, "final": {"e_trans_mm": float(error)}}
        for (i, j, k), error in np.ndenumerate(errors)
    ]


def test_the_ratio_is_that_of_pairs_in_any_order():
    base = np.random.default_rng(0).uniform(1, 50, (4, 2, 3))
    ratio = error_ratio(trials(2 * base)[::-1], trials(base))
    assert ratio.value == ratio.median == pytest.approx(2)
    assert (ratio.low, ratio.high) == pytest.approx((2, 2))
    assert ratio.pairs == 24


def test_trials_without_a_partner_do_not_count():
    base = np.full((2, 2, 3), 4.0)
    more = np.full((2, 2, 5), 6.0)
    more[..., 3:] = 1000
    assert error_ratio(trials(more), trials(base)).value == pytest.approx(1.5)


def test_seeds_on_one_slide_are_not_taken_for_independent():
    rng = np.random.default_rng(1)
    by_slide = np.exp(rng.normal(0, 1, (10, 2, 1)))
    alike = np.broadcast_to(by_slide, (10, 2, 50))
    base = trials(np.ones((10, 2, 50)))
    many, few = error_ratio(trials(alike), base), error_ratio(trials(by_slide), base)
    assert many.high - many.low == pytest.approx(few.high - few.low)
    assert many.low < many.value < many.high


def test_results_of_other_slides_are_refused():
    with pytest.raises(InputError, match="same slides and seeds"):
        error_ratio(trials(np.ones((1, 1, 1))), [])
