import numpy as np
import pytest

from midastouch_benchmark.statistics.accuracy import coverage, frames_until_right, summarise_accuracy, trust
from midastouch_benchmark.statistics.coverage import KINDS, LEVELS


def test_a_summary_is_by_variant_start_and_object(trials):
    summary = summarise_accuracy(trials)["default"]["paper"]
    assert summary["e_trans_mm"]["mean"] == pytest.approx((2 + 4 + 100) / 3)
    assert (summary["e_trans_mm"]["median"], summary["e_trans_mm"]["max"]) == (4, 100)
    assert (summary["right"], summary["converged"]) == (2, 2)
    assert summary["filter_stages_ms"] == {"motion": 1.0}
    assert "objects" not in summarise_accuracy(trials)["5k"]["paper"]
    assert summary["states"] == {"converged": 2, "ambiguous": 1}
    assert summary["objects"]["can"]["e_trans_mm"]["p90"] == pytest.approx(np.percentile([2, 4, 100], 90))


def test_a_summary_says_how_often_the_filter_was_sure_and_wrong(trials):
    trials = [*trials[:2], trials[2] | {"object": "mug", "frames_converged_right": 8}]
    summary = summarise_accuracy(trials)["default"]["paper"]
    assert summary["wrong_converged"] == pytest.approx(4 / 30)
    assert {name: one["wrong_converged"] for name, one in summary["objects"].items()} == {"can": 0.2, "mug": 0}


def test_coverage_adds_up_over_trials(trials):
    added = coverage(trials[:2])["right"]
    assert added["frames"] == 20
    assert added["observed"][8] == 0
    assert added["observed"][9] == 1


def test_frames_until_right_count_from_the_event(trials):
    lifted = [trials[0] | {"event_at": 20, "right_from_frame": k} for k in (25, 5, None)]
    assert [frames_until_right(each) for each in lifted] == [5, 0, np.inf]


def test_trust_has_an_interval_for_every_figure(trials):
    many = [trials[k % 2] | {"slide": k, "event_at": 2, "right_before_event": k % 4 < 3, "right_after_event": k % 4 > 0}
            for k in range(120)]  # fmt: skip
    one = trust(many)
    assert (one["converged_wrong"]["share"], one["right_at_end"]["share"]) == (pytest.approx(0.2), 1)
    assert one["right_after_event"]["share"] == 0.75
    assert (one["right_before_event"]["share"], one["found_again"]["share"]) == (0.75, pytest.approx(2 / 3))
    low, high = one["right_after_event"]["interval"]
    assert 0.66 < low < 0.75 < high < 0.83
    assert one["right_at_end"]["interval"] == [pytest.approx(0.97, abs=0.005), 1]
    assert one["frames_until_right"]["median"]["value"] == 1
    assert one["e_trans_mm"]["mean"]["value"] == 3
    assert one["e_trans_mm"]["mean"]["interval"] == [pytest.approx(2.8, abs=0.1), pytest.approx(3.2, abs=0.1)]
    assert one["weights"][-1]["right"]["share"] == 1


def test_trust_tells_a_wrong_belief_from_an_unsure_one(trials):
    sure, wrong, unsure = trials[0], trials[0] | {"frames_converged_right": 2}, trials[2]
    wrong = wrong | {"final": wrong["final"] | {"right": False}}
    unsure = unsure | {"frames_converged": 0, "frames_converged_right": 0}
    many = [
        one | {"slide": k, "event_at": 2, "right_before_event": one is not unsure}
        for k, one in enumerate([sure, wrong, unsure] * 40)
    ]
    trusted = trust(many)
    each = sure["frames_converged"], sure["frames_converged_right"]
    misses = each[0] - each[1]
    assert trusted["converged_frames_wrong"]["share"] == pytest.approx((misses + each[0] - 2) / (2 * each[0]))
    assert trusted["right_if_converged_at_end"]["share"] == 0.5
    assert trusted["ambiguous_frames_among"]["share"] == 0.5
    assert trusted["misled"]["share"] == (1 if misses else 0.5)
    assert trusted["misled_frames"]["mean"]["value"] == pytest.approx((misses + each[0] - 2) / 2)


def test_a_truth_among_the_modes_is_told_from_a_lost_one(trials):
    sure, lost = trials[0], trials[2]
    unsure = lost | {"final": lost["final"] | {"among_modes": True}}
    wrong = unsure | {"final": unsure["final"] | {"state": "converged"}}
    figures = trust([sure, unsure, lost, wrong])
    assert (figures["right_at_end"]["share"], figures["right_or_among_modes_at_end"]["share"]) == (0.25, 0.5)


def test_regions_are_judged_at_every_level(trials):
    counts = np.zeros(len(LEVELS) + 1, int)
    counts[[0, 16, 18, 20]] = 5, 3, 1, 1  # within 5, 85, 95 and 99.9 %
    one = trials[0] | {"coverage": dict.fromkeys(KINDS, counts.tolist())}
    regions = trust([one | {"slide": k} for k in range(120)])["regions"]
    for kind in ("converged", "right"):
        assert {level: each["share"] for level, each in regions[kind].items()} == {
            "0.5": 0.5, "0.9": 0.8, "0.95": 0.9, "0.99": 0.9,
        }  # fmt: skip
    assert regions["right"]["0.95"]["interval"][0] < 0.9 < regions["right"]["0.95"]["interval"][1]


def test_who_is_never_right_again_counts_in_the_median(trials):
    def until_right(never: int) -> dict:
        many = [trials[0] | {"slide": k, "event_at": 2} for k in range(120)]
        lost = [t | {"right_from_frame": None} for t in many[:never]]
        return trust([*lost, *many[never:]])

    assert until_right(never=20)["frames_until_right"]["median"]["value"] == 1
    lost = until_right(never=100)
    assert lost["frames_until_right"]["median"]["value"] == np.inf
