import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from midastouch_benchmark.report.point_labels import label_points


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
