import numpy as np
import pytest

from midastouch_benchmark.report.pictures import front_figure
from midastouch_benchmark.report.results_page import write_results_page
from midastouch_benchmark.statistics.accuracy import compact_trials, summarise_accuracy
from midastouch_benchmark.statistics.comparison import compare_variants
from midastouch_benchmark.statistics.coverage import KINDS, LEVELS
from midastouch_benchmark.trials.trial import ERROR_KEYS
from midastouch_benchmark.trials.variants import VARIANTS
from midastouch_tools.result_file import to_json


@pytest.fixture(scope="module")
def result(make_trial) -> dict:
    """A result of `midastouch benchmark` over two objects, three variants and both starts."""
    rng = np.random.default_rng(0)
    trials = [
        make_trial(
            variant,
            seed,
            100.0 if variant == "paper" else 8.0,
            {key: rng.uniform(1, 9) for key in ERROR_KEYS},
            object=name,
            init=init,
            coverage={kind: rng.integers(0, 5, len(LEVELS) + 1).tolist() for kind in KINDS},
        )
        for name in ("can", "mug")
        for init in ("paper", "uniform")
        for seed in range(3)
        for variant in ("default", "paper", "5k")
    ]
    return to_json(
        {
            "command": "midastouch benchmark --variant paper 5k",
            "config": {
                "inits": ["paper", "uniform"], "beta": 1.0, "slides": [0], "seeds": [0, 1, 2], "stride": 1,
                "protocol": "plain", "slide_length_m": 0.5, "codebook_size": 50_000, "jobs": 1,
                "networks": {"tdn": "t-1", "tcn": "c-1"},
            },
            "machine": {"cpu": "a cpu"},
            "objects": [
                {"object": "can", "symmetry": "axis"},
                {"object": "mug", "symmetry": "none"},
            ],
            "variants": {name: VARIANTS[name].describe() for name in ("default", "paper", "5k")},
            "levels": LEVELS,
            "missing_trials": 0,
            "summary": summarise_accuracy(trials),
            "comparison": compare_variants(trials),
            "trials": compact_trials(trials),
        }
    )  # fmt: skip


def test_a_benchmark_has_its_section(result, tmp_path):
    text = write_results_page([("accuracy.json", result)], tmp_path).read_text()
    markdown = (tmp_path / "index.md").read_text()
    for words in ("Accuracy over 2 objects", "start: uniform", "axis", "7.4 mm"):
        assert words in text
        assert words in markdown
    assert VARIANTS["5k"].summary in text
    assert VARIANTS["5k"].summary in markdown
    assert "\n```\nmidastouch benchmark --variant paper 5k\n```\n" in markdown
    pictures = {path.name for path in tmp_path.glob("*.png")}
    assert pictures == {*(f"benchmark_0_{init}_errors.png" for init in ("paper", "uniform")), "benchmark_0_front.png"}
    assert all(f"]({picture})" in markdown for picture in pictures)


def test_without_variants_there_is_no_front(result, tmp_path):
    alone = result | {key: {"default": result[key]["default"]} for key in ("variants", "summary")}
    alone["comparison"] = [row for row in result["comparison"] if row["variant"] == "default"]
    write_results_page([("accuracy.json", alone)], tmp_path)
    assert not list(tmp_path.glob("*front.png"))


DESCRIPTIONS = {name: VARIANTS[name].describe() for name in ("default", "paper", "5k", "fast")}


@pytest.fixture
def comparison() -> list[dict]:
    points = {"default": (8, 3), "paper": (100, 30), "5k": (2, 9), "fast": (4, 5)}
    return [
        {"init": init, "variant": name, "trials": 5, "cpu_ms_filter": ms, "e_trans_mm": e}
        for init in ("paper", "uniform")
        for name, (ms, e) in points.items()
    ]


def test_every_start_has_its_panel(comparison):
    figure = front_figure(comparison, DESCRIPTIONS)
    assert [axes.get_title(loc="left") for axes in figure.axes] == [
        "start: paper, 5 trials each",
        "start: uniform, 5 trials each",
    ]
    for axes in figure.axes:
        assert {text.get_text() for text in axes.texts} == {"default", "5k", "fast"}  # "paper" is far from the front
        assert axes.get_xscale() == "log"


def test_the_front_joins_what_nothing_beats(comparison):
    lines = {line.get_label(): line for line in front_figure(comparison, DESCRIPTIONS).axes[0].lines}
    assert lines["Pareto front"].get_xydata().tolist() == [[2, 9], [4, 5], [8, 3]]
    for label, point in {"default, as shipped": [8, 3], "a preset": [4, 5]}.items():
        marked = lines[label]
        assert marked.get_xydata().tolist() == [point]
        assert marked.get_marker() not in {line.get_marker() for line in lines.values() if line is not marked}
