"""The page of a run of the demo: table, pictures and an animation."""

from __future__ import annotations

from pathlib import Path

from midastouch_common.mesh import ObjectMesh
from midastouch_perception.codebook import Codebook

from ..bags.snapshot import Snapshot
from ..drawing.calibration import TITLES, figure_rows
from ..drawing.figures import save
from ..drawing.page import Page
from ..drawing.relief_rows import relief_figure
from ..drawing.run_pictures import add_run
from .calibration import calibrated_touches
from .result import result_rows


def write_page(run: list[Snapshot], mesh: ObjectMesh, codebook: Codebook, result: dict, out: Path) -> Path:
    """Draw the frames of a run into the folder `out`; returns its `index.html`."""
    page = Page(f"MidasTouch demo: {mesh.name}")
    page.table(*result_rows(result))
    add_run(page, run, mesh, codebook, out)
    _add_calibration(page, mesh, out)
    page.note("Recorded in run.mcap: inputs, ground truth and all results. Play it with: midastouch replay run.mcap")
    page.heading("Next: a finger that explores by itself")
    page.note("This slide was made beforehand. Here a simulated finger decides itself where to touch, until it knows:")
    page.code("midastouch run explore")
    page.note("Its tutorial: docs/tutorials/without_hardware.md")
    return page.write(out / "index.html")


def _add_calibration(page: Page, mesh: ObjectMesh, out: Path) -> None:
    """What the same object would feel like on a simulated sensor that is not the network's, before and after."""
    calibration, rows = calibrated_touches(mesh)
    page.heading("A sensor that is calibrated")
    page.note(
        "Every DIGIT shows a touch in other colours. A simulated one, on which the network alone feels too deep, feels "
        "the object before and after ten presses of a ball (midastouch calibrate)."
    )
    page.table(["on presses not calibrated with, median", "before", "after", "truth"], figure_rows(calibration))
    page.picture(save(relief_figure(rows, TITLES), out / "calibration.png"), "Touches before and after calibration")
