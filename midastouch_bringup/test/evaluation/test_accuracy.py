import json

import numpy as np
import pytest

from midastouch_bringup.evaluation.accuracy import (
    accuracy_text,
    compact_trials,
    compare_variants,
    coverage,
    pareto_front,
    recovery,
    recovery_text,
    summarise_accuracy,
)
from midastouch_bringup.evaluation.result_file import write_compact_json
from midastouch_bringup.evaluation.trial import ERROR_KEYS


@pytest.fixture(scope="module")
def trials(make_trial) -> list[dict]:
    def trial(variant: str, seed: int, error: float, filter_ms: float, **final) -> dict:
        return make_trial(variant, seed, filter_ms, dict.fromkeys(ERROR_KEYS, error) | final)

    return [
        trial("default", 0, 2.0, 7.0, symmetric_e_trans_mm=1.0),
        trial("default", 1, 4.0, 9.0),
        trial("default", 2, 100.0, 7.0, state="ambiguous"),
        trial("paper", 0, 12.0, 97.0),
        trial("paper", 1, 12.0, 97.0),
        trial("1k", 0, 5.0, 1.0),
        trial("1k", 1, 5.0, 1.0),
    ]


def test_variants_are_compared_on_the_trials_that_both_have_run(trials):
    rows = {row["variant"]: row for row in compare_variants(trials)}
    assert rows["default"]["error_ratio"] == 1
    assert rows["paper"]["trials"] == 2
    assert rows["paper"]["error_ratio"] == pytest.approx(12 / 3)
    assert rows["paper"]["time_ratio"] == pytest.approx(100 / 11)
    assert rows["paper"]["filter_ratio"] == pytest.approx(97 / 8)
    assert rows["paper"]["right"] == 0
    assert rows["1k"]["right"] == 1
    assert rows["default"]["wrong_converged"] == pytest.approx(0.2)


def test_the_front_holds_what_nothing_beats_in_both():
    rows = [{"ms": ms, "e_trans_mm": e} for ms, e in ((10, 3), (4, 5), (20, 4), (4, 6), (30, 1))]
    assert [(row["ms"], row["e_trans_mm"]) for row in pareto_front(rows)] == [(4, 5), (10, 3), (30, 1)]


def test_a_summary_takes_plain_errors_where_there_is_no_symmetric_one(trials):
    summary = summarise_accuracy(trials)["default"]["paper"]
    assert summary["symmetric_e_trans_mm"]["mean"] == pytest.approx((1 + 4 + 100) / 3)
    assert summary["e_trans_mm"]["mean"] == pytest.approx((2 + 4 + 100) / 3)
    assert (summary["right"], summary["right_symmetric"], summary["converged"]) == (2, 2, 2)
    assert summary["filter_stages_ms"] == {"motion": 1.0}
    assert "objects" not in summarise_accuracy(trials)["1k"]["paper"]
    assert summary["states"] == {"converged": 2, "ambiguous": 1}
    assert summary["objects"]["can"]["e_trans_mm"]["p90"] == pytest.approx(np.percentile([2, 4, 100], 90))


def test_coverage_adds_up_over_trials(trials):
    added = coverage(trials[:2])["right"]
    assert added["frames"] == 20
    assert added["observed"][8] == 0
    assert added["observed"][9] == 1


def test_recovery_counts_frames_from_the_next_touch(trials):
    assert recovery(trials) is None
    lifted = [trials[0] | {"touched_again_at": 20, "right_from_frame": k} for k in (25, 5, None)]
    back = recovery([*lifted, trials[1]])
    assert (back["trials"], back["recovered"], back["median_frames"]) == (3, 2, 2.5)
    assert recovery_text(back).startswith("right again in 2 of 3 trials")
    assert recovery_text(recovery(lifted[2:])).endswith("lifted")


def test_it_is_printed_and_written_in_few_lines(trials, tmp_path):
    result = {
        "config": {"inits": ["paper"]},
        "objects": [{"object": "can", "symmetry": "axis"}],
        "variants": {"default": {}, "paper": {}, "1k": {}},
        "summary": summarise_accuracy(trials),
        "comparison": compare_variants(trials),
        "trials": compact_trials(trials),
    }
    text = accuracy_text(result)
    for word in ("can", "axis", "paper", "67 %", "90 % region"):
        assert word in text
    write_compact_json(tmp_path / "r.json", result | {"third": 1 / 3})
    written = json.loads((tmp_path / "r.json").read_text())
    assert written["trials"][3]["final"]["e_trans_mm"] == 12
    assert written["third"] == 0.3333
    assert "filter_stages_ms" not in written["trials"][3]
    assert len((tmp_path / "r.json").read_text().splitlines()) < 40
