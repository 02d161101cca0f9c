import math

import pytest

from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.reweighting import LikelihoodTrend

OUTLIER = 0.05
WORST = math.log(OUTLIER)


def after(values, **config):
    trend = LikelihoodTrend(FilterConfig(**config), OUTLIER)
    for value in values:
        trend.update(value, 1.0)
    return trend


def test_injects_after_a_collapse_only():
    assert after([]).injection == 0
    assert after([2.0] * 30).injection == 0
    assert after([0.0] * 100).injection == 0  # a ball: nothing is ever told, nothing has collapsed
    collapsed = after([2.0] * 30 + [WORST] * 8)
    assert 0 < collapsed.injection <= FilterConfig().recovery_fraction
    assert collapsed.support > 0.6


def test_gives_up_injecting_when_nothing_ever_fits():
    assert after([WORST] * 8).injection > 0
    assert after([WORST] * 1000).injection < 0.01 * FilterConfig().recovery_fraction + 1e-12


def test_a_correlated_touch_counts_in_part():
    whole, tenth = after([1.0]), LikelihoodTrend(FilterConfig(), OUTLIER)
    tenth.update(1.0, 0.1)
    assert tenth.short == pytest.approx(0.1 * whole.short)


def test_an_impossible_touch_does_not_poison_the_averages():
    trend = after([-math.inf] * 3 + [1.0] * 40)
    assert trend.short == pytest.approx(1.0, abs=1e-6)
    assert math.isfinite(trend.long)
    assert trend.support < 0


def test_can_be_switched_off():
    assert after([2.0] * 30 + [WORST] * 8, recovery=False).injection == 0
