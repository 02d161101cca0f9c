import json

import pytest

from midastouch_benchmark.statistics.accuracy import compact_trials, summarise_accuracy
from midastouch_benchmark.statistics.comparison import compare_variants
from midastouch_benchmark.tables.accuracy import objects, real_row
from midastouch_benchmark.tables.experiments import EXPERIMENTS, of_start
from midastouch_benchmark.tables.table import shown
from midastouch_benchmark.trials.sequence_trials import PAPER_REAL
from midastouch_benchmark.trials.variants import DEFAULT, VARIANTS
from midastouch_tools.result_file import write_compact_json


@pytest.fixture
def result(trials) -> dict:
    return {
        "objects": [{"object": "can", "symmetry": "axis"}],
        "variants": {name: VARIANTS[name].describe() for name in ("default", "paper", "5k")},
        "summary": summarise_accuracy(trials),
        "comparison": compare_variants(trials),
        "trials": compact_trials(trials),
    }


def test_a_terminal_is_shown_every_table_of_a_benchmark(result):
    text = shown(EXPERIMENTS["benchmark"].tables(result))
    for word in ("can", "axis", "2 of 3", "7.4 mm, 9.4 deg", "too few trials (3)", VARIANTS["paper"].summary, "0 of 2"):
        assert word in text


def test_a_result_file_is_compact(result, tmp_path):
    write_compact_json(tmp_path / "r.json", result | {"third": 1 / 3})
    written = json.loads((tmp_path / "r.json").read_text())
    assert written["trials"][3]["final"]["e_trans_mm"] == 12
    assert written["third"] == 0.3333
    assert "filter_stages_ms" not in written["trials"][3]
    assert len((tmp_path / "r.json").read_text().splitlines()) < 40


def test_events_grasps_and_other_methods_have_their_tables(trials):
    figure = {"share": 0.5, "interval": [0.4, 0.6]}
    grasp = {"trials": 3} | dict.fromkeys(("found", "share", "right", "converged", "converged_wrong"), figure)
    many = [trial | {"slide": k, "event_at": 2} for k in range(40) for trial in trials]
    summary = summarise_accuracy(many)
    for by_init in summary.values():
        by_init["paper"]["held"] = [grasp, grasp]
    variants = {name: VARIANTS[name].describe() for name in summary}
    tables = dict(of_start({"objects": [], "variants": variants, "summary": summary, "trials": many}, "paper"))
    assert {"around the event", "held still", "methods on the same slides"} <= set(tables)
    assert len(tables["methods on the same slides"]) == 2
    assert list(tables["held still"]["pose right"]) == ["too few (3)"] * 6


def test_the_paper_s_real_slides_stand_beside_ours(trials):
    """Paper: 1.97 cm and 21.48 deg (section 6.2); closest mode 1.11 cm and 10.76 deg (appendix E)."""
    summary = summarise_accuracy(trials)[DEFAULT]["paper"]
    table = objects(summary, beside=real_row({"paper_real": PAPER_REAL}))
    *_, ours, paper = table["particles, mean"]
    assert (ours[-3:], paper) == ("deg", "19.7 mm, 21.5 deg")
    assert list(table["trials"])[-1] == 500
    assert real_row({}) is None
