"""The section of `midastouch bench-scale`: time and memory over particles and codebook poses."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from ..evaluation.speed.scaling import USUAL, scaling_table
from .figures import MODE_COLOUR, save, style_axes
from .page import Page


def scaling_section(page: Page, contents: list[dict], folder: Path) -> None:
    """Table and curves of each result."""
    for k, content in enumerate(contents):
        page.heading(f"Time and memory of the filter, on {content['object']}")
        page.note(f"{content['frames']} frames, {content['threads']} cores; the number of particles is kept")
        page.table(*scaling_table(content["scaling"]))
        caption = f"The other number is {USUAL:,}. CPU time counts all threads"
        page.picture(save(scaling_figure(content["scaling"]), folder / f"scaling_{k}.png"), caption)


def scaling_figure(points: list[dict]) -> Figure:
    """CPU time of a step and memory, each over particles and over poses, all logarithmic."""
    figure = Figure(figsize=(9, 6), layout="constrained")
    for column, (varied, other) in enumerate((("particles", "poses"), ("poses", "particles"))):
        shown = sorted((point for point in points if point[other] == USUAL), key=lambda point: point[varied])
        numbers = [point[varied] for point in shown]
        times, memory = [point["step_ms"]["cpu"] for point in shown], [point["memory_mb"] for point in shown]
        for row, (label, values) in enumerate((("CPU ms a step", times), ("memory MiB", memory))):
            axes = figure.add_subplot(2, 2, 2 * row + column + 1)
            axes.loglog(numbers, values, "o-", color=MODE_COLOUR, ms=5, lw=1.4)
            style_axes(axes, label, "particles" if varied == "particles" else "codebook poses")
            axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
            axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
            axes.yaxis.set_minor_formatter(NullFormatter())
    return figure
