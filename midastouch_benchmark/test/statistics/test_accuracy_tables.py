import json

from midastouch_benchmark.statistics.accuracy import compact_trials, summarise_accuracy
from midastouch_benchmark.statistics.accuracy_tables import accuracy_text, paper_text
from midastouch_benchmark.statistics.comparison import compare_variants
from midastouch_bringup.result_file import write_compact_json


def test_the_paper_is_named_with_the_share_of_its_errors_that_is_left(trials):
    text = paper_text(summarise_accuracy(trials[:2])["default"]["paper"])  # 3 mm and 3 deg throughout
    assert "particles mean 7.4 mm, 9.43 deg (here 0.41, 0.32 of it)" in text
    assert "closest mode median 2.8 mm, 2.03 deg (here 1.07, 1.48 of it)" in text


def test_it_is_printed_and_written_in_few_lines(trials, tmp_path):
    result = {
        "objects": [{"object": "can", "symmetry": "axis"}],
        "variants": {name: {"summary": f"about {name}"} for name in ("default", "paper", "1k")},
        "summary": summarise_accuracy(trials),
        "comparison": compare_variants(trials),
        "trials": compact_trials(trials),
    }
    text = accuracy_text(result)
    for word in (
        "can",
        "axis",
        "about paper",
        "67 %",
        "90 % region",
        "NEES",
        "7.4 mm",
        "too few (3)",
        "too few trials (2)",
    ):
        assert word in text
    write_compact_json(tmp_path / "r.json", result | {"third": 1 / 3})
    written = json.loads((tmp_path / "r.json").read_text())
    assert written["trials"][3]["final"]["e_trans_mm"] == 12
    assert written["third"] == 0.3333
    assert "filter_stages_ms" not in written["trials"][3]
    assert len((tmp_path / "r.json").read_text().splitlines()) < 40
