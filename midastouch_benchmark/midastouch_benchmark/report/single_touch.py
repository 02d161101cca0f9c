"""Pictures of single-touch results: the paper's figure 14."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from matplotlib import colormaps
from matplotlib.figure import Figure

from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh
from midastouch_tools.drawing.figures import MODE_COLOUR, PARTICLE_COLOUR
from midastouch_tools.drawing.object_view import ObjectView

_ERROR_COLOURS = colormaps["RdYlBu_r"]
_VIEW_WIDTH = 420


def pictures(content: dict) -> Iterator[tuple[str, str, Figure | np.ndarray] | str]:
    """Yield name, caption and picture of each picture of a `single-touch` result; a text says why one is missing."""
    objects = sorted(content["objects"], key=lambda one: one["summary"]["normalised_top25_error"])
    yield "", "Error over that of random touches, best object first; bars: median", violin_figure(objects)
    for one in objects:
        if not (one["mesh"] and Path(one["mesh"]).is_file()):
            yield f"{one['object']}: no picture, the mesh {one['mesh']} is not there"
            continue
        caption = f"{one['object']}: where a touch tells the place (blue) and where it does not (red), means over 5 mm"
        picture = error_picture(overview(ObjectMesh.load(one["mesh"]), _VIEW_WIDTH), np.array(one["cells"], float))
        yield f"_{one['object']}", caption, picture


def overview(mesh: ObjectMesh, width: int) -> ObjectView:
    """Return a view of the mesh from the side that shows most of its surface."""
    points, normals, _ = mesh.sample_surface(400, np.random.default_rng(0))
    return ObjectView(mesh, se3.make(se3.frame_from_normal(normals, np.zeros(len(normals))), points), width)


def error_picture(view: ObjectView, cells: np.ndarray) -> np.ndarray:
    """Paint the mean error by place, rows (C, 8) of `CELL_COLUMNS`, on the object, blue 0 to red 1; (H, W, 3) uint8."""
    error, touches = cells[:, 6], cells[:, 7]

    def colours(sums: np.ndarray) -> np.ndarray:
        return _ERROR_COLOURS(np.clip(sums[:, 0] / sums[:, 1], 0, 1))[:, :3]

    return view.painted(1e-3 * cells[:, :3], cells[:, 3:6], np.stack([error * touches, touches], axis=1), colours)


def violin_figure(objects: list[dict]) -> Figure:
    """Plot the distribution of the normalised top-25 error of each object, by its `errors`."""
    figure = Figure(figsize=(max(5.0, 1.15 * len(objects) + 1.5), 3.8), layout="constrained")
    axes = figure.subplots()
    places = np.arange(len(objects)) + 1.0
    errors = [one["errors"] for one in objects]
    drawn = axes.violinplot(errors, places, widths=0.85, showextrema=False, showmedians=True)
    for body in drawn["bodies"]:  # type: ignore[attr-defined] # it is a list
        body.set(facecolor=MODE_COLOUR, alpha=0.65, linewidth=0)
    axes.axhline(1.0, color=PARTICLE_COLOUR, lw=1, ls="--")
    axes.set_xticks(places, [one["object"] for one in objects], fontsize=8, rotation=20, ha="right")
    axes.set_ylabel("top-25 pose error / random touches", fontsize=9)
    axes.tick_params(axis="y", labelsize=8)
    axes.set_ylim(0, max(1.5, *(np.percentile(some, 99.5) for some in errors)))
    axes.spines[["top", "right"]].set_visible(False)
    return figure
