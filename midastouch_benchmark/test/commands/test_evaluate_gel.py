import json

import pytest

from midastouch_benchmark.tables.soft_gel import commanded_depth, soft_gel
from midastouch_tools import cli


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    told = tmp_path_factory.mktemp("gel") / "gel.json"
    args = ["evaluate-gel", "--objects", "eyebolt", "--touches", "3", "--presses", "3", "--json", str(told)]
    assert cli.main(args) == 0
    return json.loads(told.read_text())


@pytest.mark.slow
def test_every_gel_sees_the_same_touches_and_presses(result):
    kinds = {(row["sensor"], row["calibrated"], row["thickness_mm"]) for row in result["touches"]}
    assert len(kinds) == 2 * 2 * 4
    assert len(result["touches"]) == 3 * len(kinds)
    for press in ("ball", "flat face"):
        commanded = [row["commanded_mm"] for row in result["presses"] if row["press"] == press]
        assert len(commanded) == 3 * len(kinds)
        assert len(set(commanded)) == 3
        assert all(0.1 < each < 1.05 for each in commanded)


@pytest.mark.slow
def test_thicker_gel_gives_way_further_beside_a_touch(result):
    """So the outline is smaller, and a pose that ends at it lies further out."""

    def mean(thickness_mm: float, key: str) -> float:
        values = [row[key] for row in result["touches"] if row["thickness_mm"] == thickness_mm and key in row]
        return sum(values) / len(values)

    assert mean(6.0, "area") < mean(1.5, "area")
    assert mean(6.0, "normal_mm") > mean(1.5, "normal_mm") + 0.1


@pytest.mark.slow
def test_its_tables_show_what_was_measured(result):
    gels = ["as fitted", "elastic, 1.5 mm", "elastic, 3 mm", "elastic, 6 mm"]
    assert soft_gel(result)["gel"].tolist() == 2 * gels
    assert commanded_depth(result)["presses"].tolist() == 16 * ["6"]
