"""Comparisons that stop when they are decided."""

import dataclasses

import pytest

from midastouch_benchmark.trials import campaign
from midastouch_benchmark.trials.cache import Cache
from midastouch_benchmark.trials.campaign import Plan
from midastouch_filter.core.config import FilterConfig


@pytest.fixture
def asked(monkeypatch, trials, tmp_path):
    """Runs looks over a campaign in which `clear` differs from the default, and `unclear` does not tell; what was asked
    for, and the trials."""

    def of(variant: str, slide: int) -> dict:
        error = {"default": 3.0, "clear": 8.0, "unclear": 3.0 + 20 * (-1) ** slide}[variant]
        one = trials[0]
        return one | {"variant": variant, "slide": slide, "final": one["final"] | {"e_trans_mm": error}}

    def run(count: int, missing: int = 0) -> tuple[list, list]:
        calls = []

        def run_campaign(plan, *_):
            calls.append((plan.slides[0], plan.variants))
            return [of(variant, slide) for variant in plan.variants for slide in plan.slides], missing

        monkeypatch.setattr(campaign, "run_campaign", run_campaign)
        plan = Plan(Cache(tmp_path), FilterConfig(), ("default", "clear", "unclear"), slides=tuple(range(100)))
        found, _ = campaign.run_in_looks(dataclasses.replace(plan), [], None, None, count)
        return calls, found

    return run


def test_only_what_is_undecided_gets_more_slides(asked):
    calls, found = asked(3)
    undecided = ("default", "unclear")
    assert calls == [(0, ("default", "clear", "unclear")), (100, undecided), (200, undecided)]
    assert sum(trial["variant"] == "clear" for trial in found) == 100


def test_one_look_is_a_campaign_and_a_deadline_ends_it(asked):
    assert len(asked(1)[0]) == 1
    assert len(asked(3, missing=5)[0]) == 1
