"""The pictures of a recorded run on a page: animation, overview, end, errors."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from PIL import Image
from tqdm import tqdm

from midastouch_common.files import atomic_path
from midastouch_common.mesh import ObjectMesh
from midastouch_perception.codebook import Codebook

from ..bags.snapshot import Snapshot, moments
from ..progress import progress_bar
from .animation import write_gif
from .figures import error_figure, run_figure, save
from .object_view import ObjectView
from .page import Page

_COLUMNS = 5
GIF_FRAMES = 60


def add_run(page: Page, run: list[Snapshot], mesh: ObjectMesh, codebook: Codebook, out: Path) -> None:
    """Draw the frames of a run into the folder `out` and add the pictures to a page there."""
    view = ObjectView(mesh, np.array([s.truth for s in run]), 760)
    title = f"{mesh.name}, {len(run)} frames"
    overview = save(run_figure(view, codebook, moments(run, _COLUMNS), run, title), out / "run.png")
    errors = save(error_figure(run), out / "errors.png")
    final = out / "final.png"
    with atomic_path(final) as temporary:
        Image.fromarray(view.particles(run[-1])).save(temporary)
    with progress_bar(unit="picture") as bar:
        animation = write_gif(out / "run.gif", view, run, GIF_FRAMES, lambda chosen: _ticked(chosen, bar))
    page.picture(animation, "The run: particles on the object, touch, errors")
    page.picture(overview, "Touch, its likelihood over the object, particles, errors (the paper's figure 7)")
    page.picture(final, "Particles, modes and ground truth at the end")
    page.picture(errors, "Errors over time")


def _ticked(items: list, bar: tqdm) -> Iterator:
    bar.reset(len(items))
    for item in items:
        yield item
        bar.update()
