import numpy as np
import pytest

from midastouch_benchmark.statistics.accuracy import coverage, recovery, summarise_accuracy
from midastouch_benchmark.statistics.accuracy_tables import coverage_table, recovery_text
from midastouch_benchmark.statistics.coverage import KINDS, LEVELS


def test_a_summary_takes_plain_errors_where_there_is_no_symmetric_one(trials):
    summary = summarise_accuracy(trials)["default"]["paper"]
    assert summary["symmetric_e_trans_mm"]["mean"] == pytest.approx((1 + 4 + 100) / 3)
    assert summary["e_trans_mm"]["mean"] == pytest.approx((2 + 4 + 100) / 3)
    assert (summary["right"], summary["right_symmetric"], summary["converged"]) == (2, 2, 2)
    assert summary["filter_stages_ms"] == {"motion": 1.0}
    assert "objects" not in summarise_accuracy(trials)["1k"]["paper"]
    assert summary["states"] == {"converged": 2, "ambiguous": 1}
    assert summary["objects"]["can"]["e_trans_mm"]["p90"] == pytest.approx(np.percentile([2, 4, 100], 90))


def test_a_summary_says_how_often_the_filter_was_sure_and_wrong(trials):
    trials = [*trials[:2], trials[2] | {"object": "mug", "frames_converged_right": 8}]
    summary = summarise_accuracy(trials)["default"]["paper"]
    assert summary["wrong_converged"] == pytest.approx(4 / 30)
    assert {name: one["wrong_converged"] for name, one in summary["objects"].items()} == {"can": 0.2, "mug": 0}


def test_a_calibrated_covariance_has_the_median_of_a_chi_square(trials):
    even = np.diff([0, *LEVELS, 1])
    calibrated = trials[0] | {"coverage": dict.fromkeys(KINDS, np.round(1000 * even).astype(int).tolist())}
    assert coverage([calibrated])["right"]["median_nees"] == pytest.approx(5.35, abs=0.01)
    beyond = trials[0] | {"coverage": dict.fromkeys(KINDS, [0] * len(LEVELS) + [10])}
    assert coverage([beyond])["right"]["median_nees"] is None
    header, (row, *_) = coverage_table(coverage([beyond]))
    assert header[-1] == "median NEES (calibrated: 5.3)"
    assert row == ["one mode", 10, "0 %", "0 %", "0 %", "0 %", "> 22"]
    none = coverage_table(coverage([trials[0] | {"coverage": dict.fromkeys(KINDS, [0] * (len(LEVELS) + 1))}]))
    assert none[1][0] == ["one mode", 0, "-", "-", "-", "-", "-"]


def test_coverage_adds_up_over_trials(trials):
    added = coverage(trials[:2])["right"]
    assert added["frames"] == 20
    assert added["observed"][8] == 0
    assert added["observed"][9] == 1


def test_recovery_counts_frames_from_the_event(trials):
    assert recovery(trials) is None
    lifted = [trials[0] | {"event_at": 20, "right_from_frame": k} for k in (25, 5, None)]
    back = recovery([*lifted, trials[1]])
    assert (back["trials"], back["recovered"], back["median_frames"]) == (3, 2, 2.5)
    assert recovery_text(back).startswith("right again in 2 of 3 trials")
    assert recovery_text(recovery(lifted[2:])).endswith("event")
