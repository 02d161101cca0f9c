"""The page of an exploration: table, animation and pictures, or in words why there are none."""

from __future__ import annotations

from pathlib import Path

from midastouch_common.mesh import ObjectMesh
from midastouch_perception.codebook import Codebook

from ..bags.snapshot import Snapshot
from ..drawing.figures import identity_figure, save
from ..drawing.page import Page
from ..drawing.run_pictures import add_run
from .result import result_rows


def write_page(run: list[Snapshot], mesh: ObjectMesh, codebook: Codebook, result: dict, out: Path) -> Path:
    """Draw the frames of a run into the folder `out`; returns its `index.html`.

    Frames whose penetration was not recorded, as the first may not be, are left out.
    """
    run = [one for one in run if one.penetration is not None]
    if not run:
        return write_words(result, "no frame was recorded with what the gel felt", out)
    page = _begun(result)
    if any(one.objects for one in run):
        page.picture(save(identity_figure(run), out / "objects.png"), "Which object it is, for the filter")
        page.note("While another object leads, the particles below are places on that one.")
    add_run(page, run, mesh, codebook, out)
    page.note("Recorded in run.mcap: inputs, ground truth and all results. Play it with: midastouch replay run.mcap")
    return page.write(out / "index.html")


def write_words(result: dict, why: str, out: Path) -> Path:
    """The same of a run of which there is nothing to draw, for this reason."""
    page = _begun(result)
    page.note(f"There is nothing to draw: {why}")
    return page.write(out / "index.html")


def _begun(result: dict) -> Page:
    page = Page(f"A finger explores: {result['object']}")
    page.table(*result_rows(result))
    return page
