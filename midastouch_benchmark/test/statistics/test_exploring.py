"""Figures of closed-loop trials, of trials whose figures are known."""

import numpy as np
import pytest

from midastouch_benchmark.statistics.exploring import summarise_exploration
from midastouch_benchmark.trials.exploration import chosen_policies
from midastouch_common.errors import InputError


def trial(policy, seed, ending="converged", right=True, path=0.1):
    return {
        "object": "mug", "policy": policy, "seed": seed, "ending": ending, "right": right, "path_m": path,
        "asked_ms": None if policy == "random" else [20.0, 30.0],
    }  # fmt: skip


@pytest.fixture(scope="module")
def summary():
    suggested = [trial("suggested", k, path=0.1) for k in range(4)]
    suggested += [trial("suggested", 4, "alike"), trial("suggested", 5, right=False)]
    random = [trial("random", k, path=0.2 + 0.1 * k) for k in range(3)]
    random += [trial("random", 3, "given up", path=1.0)]
    return summarise_exploration(suggested + random)


def test_shares_and_paths(summary):
    one = summary["suggested"]
    assert one["right"]["share"] == pytest.approx(4 / 6)
    assert one["wrong"]["share"] == pytest.approx(1 / 6)
    assert one["alike"]["share"] == pytest.approx(1 / 6)
    assert one["path_m"]["value"] == pytest.approx(0.1)
    assert not one["enough"]


def test_who_does_not_find_out_has_an_endless_path(summary):
    assert summary["random"]["path_m"]["value"] == pytest.approx(0.35)
    assert summary["suggested"]["path_ratio"] == pytest.approx(0.1 / 0.35)
    lost = summarise_exploration([trial("random", k, "given up") for k in range(3)])["random"]
    assert np.isinf(lost["path_m"]["value"])
    assert lost["path_ratio"] is None


def test_an_unknown_policy_is_named():
    assert chosen_policies(None) == ("suggested", "lifts", "random")
    assert chosen_policies(["random", "random"]) == ("random",)
    with pytest.raises(InputError, match="--policy wise"):
        chosen_policies(["wise"])
