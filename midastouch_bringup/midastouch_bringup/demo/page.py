"""The page of a run of the demo: table, pictures and an animation."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from PIL import Image
from tqdm import tqdm

from midastouch_perception.codebook import Codebook
from midastouch_perception.files import atomic_path
from midastouch_perception.mesh import ObjectMesh

from ..progress import progress_bar
from ..report.animation import write_gif
from ..report.calibration import TITLES, figure_rows
from ..report.figures import error_figure, run_figure, save
from ..report.object_view import ObjectView
from ..report.page import Page
from ..report.relief_rows import relief_figure
from ..report.snapshot import Snapshot, moments
from .calibration import calibrated_touches
from .result import result_rows

_COLUMNS = 5
GIF_FRAMES = 60


def write_page(run: list[Snapshot], mesh: ObjectMesh, codebook: Codebook, result: dict, out: Path) -> Path:
    """Draw the frames of a run into the folder `out`; returns its `index.html`."""
    view = ObjectView(mesh, np.array([s.truth for s in run]), 760)
    overview = save(
        run_figure(view, codebook, moments(run, _COLUMNS), run, f"{mesh.name}, {len(run)} frames"), out / "run.png"
    )
    errors = save(error_figure(run), out / "errors.png")
    final = out / "final.png"
    with atomic_path(final) as temporary:
        Image.fromarray(view.particles(run[-1])).save(temporary)
    with progress_bar(unit="picture") as bar:
        animation = write_gif(out / "run.gif", view, run, GIF_FRAMES, lambda chosen: _ticked(chosen, bar))
    page = Page(f"MidasTouch demo: {mesh.name}")
    page.table(*result_rows(result))
    page.picture(animation, "The run: particles on the object, touch, errors")
    page.picture(overview, "Touch, its likelihood over the object, particles, errors (the paper's figure 7)")
    page.picture(final, "Particles, modes and ground truth at the end")
    page.picture(errors, "Errors over time")
    _add_calibration(page, mesh, out)
    page.note("Recorded in run.mcap: inputs, ground truth and all results. Play it with: midastouch replay run.mcap")
    return page.write(out / "index.html")


def _add_calibration(page: Page, mesh: ObjectMesh, out: Path) -> None:
    """What the same object would feel like on a simulated sensor that is not the network's, before and after."""
    calibration, rows = calibrated_touches(mesh)
    page.heading("A sensor that is calibrated")
    page.note(
        "Every DIGIT shows a touch in other colours. A simulated one, whose colours the network does not know, feels "
        "the object before and after ten presses of a ball (midastouch calibrate)."
    )
    page.table(["on presses not calibrated with, median", "before", "after", "truth"], figure_rows(calibration))
    page.picture(save(relief_figure(rows, TITLES), out / "calibration.png"), "Touches before and after calibration")


def _ticked(items: list, bar: tqdm) -> Iterator:
    bar.reset(len(items))
    for item in items:
        yield item
        bar.update()
