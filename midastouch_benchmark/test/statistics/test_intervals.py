import numpy as np
import pytest

from midastouch_benchmark.statistics.intervals import bootstrap_interval, error_ratio, fraction_interval
from midastouch_common.errors import InputError


def test_independent_cases_have_wilsons_interval():
    interval = fraction_interval([1] * 8 + [0] * 2, [1] * 10, range(10))
    assert interval == pytest.approx([0.49, 0.943], abs=0.03)


def test_cases_that_go_together_count_once():
    """Ten slides of ten trials, each all right or all wrong, tell no more than ten trials."""
    right = np.repeat([1, 1, 1, 1, 1, 1, 1, 1, 0, 0], 10)
    together = fraction_interval(right, np.ones(100), np.repeat(range(10), 10))
    assert together == pytest.approx(fraction_interval(right[::10], np.ones(10), range(10)), abs=1e-9)
    alone = fraction_interval(right, np.ones(100), range(100))
    assert alone[1] - alone[0] < 0.4 * (together[1] - together[0])


def test_never_seen_is_not_impossible():
    low, high = fraction_interval([0] * 100, [50] * 100, range(100))
    assert low == 0
    assert high == pytest.approx(0.037, abs=0.001)


def test_one_wrong_frame_makes_nothing_surer_than_none():
    frames = [150] * 100
    none, one = fraction_interval([0] * 100, frames, range(100)), fraction_interval([1] + [0] * 99, frames, range(100))
    assert one[1] >= none[1]


@pytest.mark.parametrize("slides", [50, 100])
def test_the_interval_of_a_rare_fraction_covers_as_it_says(slides):
    """One slide in forty has frames at a wrong pose, a third of them."""
    rng, above = np.random.default_rng(0), 0
    for _ in range(400):
        wrong = (rng.random(slides) < 1 / 40) * rng.uniform(0, 2 / 3, slides)
        above += fraction_interval(100 * wrong, [100] * slides, range(slides))[1] < 1 / 120
    assert above < 0.025 * 400


def test_cases_in_which_nothing_was_counted_make_nothing_surer():
    some = fraction_interval([1] * 10, [1] * 10, range(10))
    assert fraction_interval([1] * 10 + [0] * 90, [1] * 10 + [0] * 90, range(100)) == some


def test_nothing_counted_has_no_interval():
    assert fraction_interval([0, 0], [0, 0], range(2)) is None
    assert bootstrap_interval([1.0, np.nan], range(2)) is None


def test_the_interval_of_a_mean_covers_it_as_often_as_it_says():
    rng = np.random.default_rng(0)
    covered = 0
    for _ in range(60):
        slides = rng.normal(0, 1, 30)
        values = np.repeat(slides, 3) + rng.normal(0, 0.3, 90)
        low, high = bootstrap_interval(values, np.repeat(range(30), 3))
        covered += low <= 0 <= high
    assert covered >= 52


def test_unknown_values_are_left_out():
    values = [1.0, 2.0, 3.0, np.nan]
    assert bootstrap_interval(values, range(4), np.median) == bootstrap_interval(values[:3], range(3), np.median)


def trials(errors: np.ndarray) -> list[dict]:
    """errors (objects, slides, seeds) mm."""
    return [
        {"object": f"o{i}", "slide": j, "init": "paper", "seed": k, "final": {"e_trans_mm": float(error)}}
        for (i, j, k), error in np.ndenumerate(errors)
    ]


def test_the_ratio_is_that_of_pairs_in_any_order():
    base = np.random.default_rng(0).uniform(1, 50, (4, 2, 3))
    ratio = error_ratio(trials(2 * base)[::-1], trials(base))
    assert ratio == pytest.approx({"value": 2, "low": 2, "high": 2, "median": 2})


def test_trials_without_a_partner_do_not_count():
    base = np.full((2, 2, 3), 4.0)
    more = np.full((2, 2, 5), 6.0)
    more[..., 3:] = 1000
    assert error_ratio(trials(more), trials(base))["value"] == pytest.approx(1.5)


def test_seeds_on_one_slide_are_not_taken_for_independent():
    rng = np.random.default_rng(1)
    by_slide = np.exp(rng.normal(0, 1, (10, 2, 1)))
    alike = np.broadcast_to(by_slide, (10, 2, 50))
    base = trials(np.ones((10, 2, 50)))
    many, few = error_ratio(trials(alike), base), error_ratio(trials(by_slide), base)
    assert many["high"] - many["low"] == pytest.approx(few["high"] - few["low"])
    assert many["low"] < many["value"] < many["high"]


def test_results_of_other_slides_are_refused():
    with pytest.raises(InputError, match="same slides and seeds"):
        error_ratio(trials(np.ones((1, 1, 1))), [])
