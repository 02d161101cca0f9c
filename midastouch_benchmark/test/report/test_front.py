import pytest

from midastouch_benchmark.report.front import front_figure
from midastouch_benchmark.trials.variants import VARIANTS

DESCRIPTIONS = {name: VARIANTS[name].describe() for name in ("default", "paper", "1k", "fast")}


@pytest.fixture
def comparison() -> list[dict]:
    points = {"default": (8, 3), "paper": (100, 30), "1k": (2, 9), "fast": (4, 5)}
    return [
        {"init": init, "variant": name, "trials": 5, "cpu_ms_filter": ms, "e_trans_mm": e, "symmetric_e_trans_mm": e}
        for init in ("paper", "uniform")
        for name, (ms, e) in points.items()
    ]


def test_every_start_has_its_panel_with_every_variant(comparison):
    figure = front_figure(comparison, DESCRIPTIONS)
    assert [axes.get_title(loc="left") for axes in figure.axes] == [
        "start: paper, 5 trials each",
        "start: uniform, 5 trials each",
    ]
    for axes in figure.axes:
        assert {text.get_text() for text in axes.texts} == {"default", "paper", "1k", "fast"}
        assert axes.get_xscale() == "log"


def test_the_front_joins_what_nothing_beats_and_default_and_presets_are_marked(comparison):
    lines = {line.get_label(): line for line in front_figure(comparison, DESCRIPTIONS).axes[0].lines}
    assert lines["Pareto front"].get_xydata().tolist() == [[2, 9], [4, 5], [8, 3]]
    for label, point in {"default, as shipped": [8, 3], "a preset": [4, 5]}.items():
        marked = lines[label]
        assert marked.get_xydata().tolist() == [point]
        assert marked.get_marker() not in {line.get_marker() for line in lines.values() if line is not marked}


def test_an_error_modulo_symmetry_has_a_row_where_it_differs(comparison):
    comparison[1]["symmetric_e_trans_mm"] = 20
    figure = front_figure(comparison, DESCRIPTIONS)
    assert len(figure.axes) == 4
    assert "modulo symmetry" in figure.axes[2].get_ylabel()
