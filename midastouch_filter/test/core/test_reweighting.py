import math

import pytest

from midastouch_filter.core.reweighting import LikelihoodTrend, Recovery

OUTLIER = 0.05
WORST = math.log(OUTLIER)
LARGEST = 0.1


def after(values):
    trend = LikelihoodTrend(OUTLIER)
    for value in values:
        trend.update(value, 1.0)
    return trend


def injected_after(values, largest=LARGEST):
    return Recovery(None, None, largest).fraction(after(values))


def test_injects_after_a_collapse_only():
    assert injected_after([]) == 0
    assert injected_after([2.0] * 30) == 0
    assert injected_after([0.0] * 100) == 0  # a ball: nothing is ever told, nothing has collapsed
    collapsed = [2.0] * 30 + [WORST] * 8
    assert 0 < injected_after(collapsed) <= LARGEST
    assert after(collapsed).support > 0.6


def test_gives_up_injecting_when_nothing_ever_fits():
    assert injected_after([WORST] * 8) > 0
    assert injected_after([WORST] * 1000) < 0.01 * LARGEST + 1e-12


def test_a_correlated_touch_counts_in_part():
    whole, tenth = after([1.0]), LikelihoodTrend(OUTLIER)
    tenth.update(1.0, 0.1)
    assert tenth.short == pytest.approx(0.1 * whole.short)


def test_an_impossible_touch_does_not_poison_the_averages():
    trend = after([-math.inf] * 3 + [1.0] * 40)
    assert trend.short == pytest.approx(1.0, abs=1e-6)
    assert math.isfinite(trend.long)
    assert trend.support < 0


def test_can_be_switched_off():
    assert injected_after([2.0] * 30 + [WORST] * 8, 0.0) == 0
