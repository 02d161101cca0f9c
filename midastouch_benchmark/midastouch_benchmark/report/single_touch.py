"""Pictures of single-touch results: the paper's figures 4 and 14."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Literal

import numpy as np
from matplotlib import colormaps
from matplotlib.cm import ScalarMappable
from matplotlib.figure import Figure

from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh
from midastouch_tools.drawing.figures import PARTICLE_COLOUR
from midastouch_tools.drawing.object_view import ObjectView

from ..single_touch.per_object import BASELINES, OURS

ERROR_COLOURS = colormaps["RdYlBu_r"]
_WAYS = {OURS: ("tactile codes", "#1f77b4"), "image_embedding": ("image embedding", "#e08a3c")}
_WAYS["minkloc3d"] = ("MinkLoc3D", "#6f9e4c")
_COLUMNS = 5
_VIEW_WIDTH = 420


def pictures(content: dict) -> Iterator[tuple[str, str, Figure] | str]:
    """Yield name, caption and figure of each picture of a `single-touch` result; a text says why one is missing."""
    objects = sorted(content["objects"], key=lambda one: one["summary"]["normalised_top25_error"])
    caption = "Error over that of random touches, whole codebook, best object first; bars: median"
    yield "", caption, violin_figure({OURS: objects})
    compared = _compared(objects)
    if len(compared) > 1:
        caption = f"The same on a book of {objects[0]['baselines']['book_size']} poses"
        yield "_methods", caption, violin_figure(compared)
    errors = {}
    for one in objects:
        if not (one["mesh"] and Path(one["mesh"]).is_file()):
            yield f"{one['object']}: no pictures, the mesh {one['mesh']} is not there"
            continue
        view = overview(ObjectMesh.load(one["mesh"]), _VIEW_WIDTH)
        title = f"{one['object']}   {one['summary']['normalised_top25_error']:.2f}"
        errors[title] = partial(error_picture, view, np.array(one["cells"], float))
    if errors:
        caption = "Where a touch tells the place (blue) and where it does not (red), means over 5 mm"
        yield "_errors", caption, grid_figure(errors)


def _compared(objects: list[dict]) -> dict[str, list[dict]]:
    """Return, for each way of encoding that all objects have, its results in the form of the objects' entries."""
    out = {}
    for way in (OURS, *BASELINES):
        details = [one["baselines"].get("details", {}).get(way) for one in objects]
        if all(details):
            out[way] = [{"object": one["object"]} | detail for one, detail in zip(objects, details, strict=True)]
    return out


def overview(mesh: ObjectMesh, width: int) -> ObjectView:
    """Return a view of the mesh from the side that shows most of its surface."""
    points, normals, _ = mesh.sample_surface(400, np.random.default_rng(0))
    return ObjectView(mesh, se3.make(se3.frame_from_normal(normals, np.zeros(len(normals))), points), width)


def error_picture(view: ObjectView, cells: np.ndarray) -> np.ndarray:
    """Paint the mean error by place, rows (C, 8) of `CELL_COLUMNS`, on the object, blue 0 to red 1; (H, W, 3) uint8."""
    error, touches = cells[:, 6], cells[:, 7]

    def colours(sums: np.ndarray) -> np.ndarray:
        return ERROR_COLOURS(np.clip(sums[:, 0] / sums[:, 1], 0, 1))[:, :3]

    return view.painted(1e-3 * cells[:, :3], cells[:, 3:6], np.stack([error * touches, touches], axis=1), colours)


def grid_figure(pictures: Mapping[str, Callable[[], np.ndarray]]) -> Figure:
    """Draw pictures of errors with their titles, five a row, and a colour bar."""
    columns = min(_COLUMNS, len(pictures))
    rows = -(-len(pictures) // columns)
    figure = Figure(figsize=(2.6 * columns + 0.7, 2.2 * rows), layout="constrained")
    axes = np.atleast_1d(figure.subplots(rows, columns)).ravel()
    for one in axes:
        one.set_axis_off()
    for one, (title, picture) in zip(axes, pictures.items(), strict=False):
        one.imshow(_framed(picture()))
        one.set_title(title, fontsize=8)
    colours = figure.colorbar(ScalarMappable(cmap=ERROR_COLOURS), ax=list(axes), fraction=0.02, pad=0.01)
    colours.set_label("error / random touches", fontsize=8)
    colours.ax.tick_params(labelsize=8)
    return figure


def _framed(picture: np.ndarray) -> np.ndarray:
    """Crop a picture (H, W, 3) to its part that is not white, and centre it in a white frame 4 wide and 3 high."""
    rows, columns = (np.flatnonzero((picture < 250).any(axis=(axis, 2))) for axis in (1, 0))
    shown = picture[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    height, width = shown.shape[:2]
    frame = np.full((max(height, -(-3 * width // 4)), max(width, -(-4 * height // 3)), 3), 255, np.uint8)
    top, left = (frame.shape[0] - height) // 2, (frame.shape[1] - width) // 2
    frame[top : top + height, left : left + width] = shown
    return frame


def violin_figure(results: dict[str, list[dict]]) -> Figure:
    """Plot the distribution of the normalised top-25 error per object: the paper's figures 4 and 14.

    results: by way of encoding, entries with `object` and `errors`, in the same order for all ways. Two ways share a
    violin, half of it each; more stand side by side.
    """
    objects = [one["object"] for one in next(iter(results.values()))]
    figure = Figure(figsize=(max(5.0, 1.15 * len(objects) + 1.5), 3.8), layout="constrained")
    axes = figure.subplots()
    places = np.arange(len(objects)) + 1.0
    for k, (way, entries) in enumerate(results.items()):
        name, colour = _WAYS[way]
        side: Literal["low", "high", "both"] = "both" if len(results) != 2 else "high" if k else "low"
        shift = 0.0 if len(results) < 3 else 0.28 * (k - (len(results) - 1) / 2)
        drawn = axes.violinplot(
            [one["errors"] for one in entries],
            places + shift,
            widths=0.85 if len(results) < 3 else 0.26,
            showextrema=False,
            showmedians=True,
            side=side,
        )
        for body in drawn["bodies"]:  # type: ignore[attr-defined] # it is a list
            body.set(facecolor=colour, alpha=0.65, linewidth=0)
        drawn["cmedians"].set(color=colour, linewidth=1.6)
        axes.fill_between([], [], color=colour, alpha=0.65, linewidth=0, label=name)
    axes.axhline(1.0, color=PARTICLE_COLOUR, lw=1, ls="--")
    axes.set_xticks(
        places,
        objects,
        fontsize=8,
        rotation=20 if len(objects) > 4 else 0,
        ha="right" if len(objects) > 4 else "center",
    )
    axes.set_ylabel("top-25 pose error / random touches", fontsize=9)
    axes.tick_params(axis="y", labelsize=8)
    axes.set_ylim(0, max(1.5, *(np.percentile(one["errors"], 99.5) for one in itertools.chain(*results.values()))))
    axes.set_xlim(0.4, len(objects) + 0.6)
    if len(results) > 1:
        axes.legend(frameon=False, fontsize=9)
    axes.spines[["top", "right"]].set_visible(False)
    return figure
