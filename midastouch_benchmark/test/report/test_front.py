import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from midastouch_benchmark.report.front import front_figure, label_points
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


def boxes(points: np.ndarray) -> tuple[list, object]:
    """Drawn extents of the labels and of the axes."""
    figure = Figure(figsize=(8, 6), layout="constrained")
    canvas = FigureCanvasAgg(figure)
    axes = figure.subplots()
    axes.plot(*points.T, "o")
    figure.draw_without_rendering()
    label_points(axes, points.tolist(), [f"variant_{k}" for k in range(len(points))])
    canvas.draw()
    # the extent of the writing alone, without the line
    extents = [super(type(text), text).get_window_extent(canvas.get_renderer()) for text in axes.texts]
    return extents, axes.get_window_extent()


@pytest.mark.parametrize("spread", [0.3, 0.05])
def test_labels_neither_overlap_nor_leave_the_axes(spread):
    rng = np.random.default_rng(0)
    outliers = np.array([[1.0, 1.0], [-1.0, 0.9]])
    extents, frame = boxes(np.concatenate([outliers, spread * rng.standard_normal((18, 2))]))
    assert len(extents) == 20
    for i, one in enumerate(extents):
        assert frame.x0 <= one.x0 < one.x1 <= frame.x1
        assert frame.y0 <= one.y0 < one.y1 <= frame.y1
        assert not any(one.overlaps(other) for other in extents[:i])


def test_a_crowd_in_one_place_is_drawn_apart():
    extents, _ = boxes(np.full((20, 2), 0.5))
    assert not any(a.overlaps(b) for i, a in enumerate(extents) for b in extents[:i])
