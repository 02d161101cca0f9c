"""The section of `midastouch bench-scale`: time and memory over particles and codebook poses."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure

from midastouch_bringup.drawing.figures import MODE_COLOUR, save, style_error_axes
from midastouch_bringup.drawing.page import Page

from ..speed.scaling import USUAL, scaling_table

# what varies, what stays, label
_COLUMNS = ("particles", "poses", "particles"), ("poses", "particles", "codebook poses")


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
    columns = figure.subplots(2, 2, sharex="col", sharey="row").T
    for (of_time, of_memory), (varied, kept, label) in zip(columns, _COLUMNS, strict=True):
        shown = sorted((point for point in points if point[kept] == USUAL), key=lambda point: point[varied])
        numbers = [point[varied] for point in shown]
        for axes, values in (
            (of_time, [point["step_ms"]["cpu"] for point in shown]),
            (of_memory, [point["memory_mb"] for point in shown]),
        ):
            axes.loglog(numbers, values, "o-", color=MODE_COLOUR, ms=5, lw=1.4)
            style_error_axes(axes, "", "")
        of_memory.set_xlabel(label, fontsize=9)
    for axes, label in zip(columns[0], ("CPU ms a step", "memory MiB"), strict=True):
        axes.set_ylabel(label, fontsize=9)
    return figure
