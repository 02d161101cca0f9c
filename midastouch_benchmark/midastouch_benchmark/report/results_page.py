"""Page that `midastouch report` makes of result files: for each the tables that its command prints, and pictures."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from PIL import Image

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.files import atomic_path
from midastouch_common.mesh import ObjectMesh
from midastouch_tools.drawing.figures import save
from midastouch_tools.drawing.object_view import ObjectView
from midastouch_tools.drawing.page import Page

from ..tables.experiments import EXPERIMENTS, written
from ..tables.table import on_page
from ..trials.variants import DEFAULT
from . import presses, single_touch
from .front import front_figure
from .trial_figures import final_error_figure, trial_error_figure

Pictures = Iterator[tuple[str, str, Figure | np.ndarray] | str]
"""End of the file's name, caption, and a figure or RGB (H, W, 3) uint8; a text says why a picture is missing."""


def write_results_page(results: list[tuple[str, dict]], folder: str | os.PathLike) -> Path:
    """Write a page on (file name, content) pairs into `folder`, as `index.html` and `index.md` with their pictures.

    Returns the path of `index.html`. Raises InputError for a file of an unknown command, or an incomplete one.
    """
    folder = Path(folder)
    kinds = [_kind(name, content) for name, content in results]
    folder.mkdir(parents=True, exist_ok=True)
    page = Page("MidasTouch results")
    for kind in EXPERIMENTS:
        some = [result for result, each in zip(results, kinds, strict=True) if each == kind]
        for number, (name, content) in enumerate(some):
            stem = f"{re.sub(r'[^a-z]+', '_', kind)}_{number}"
            try:
                _add_section(page, kind, content, folder / stem)
            except (KeyError, TypeError, IndexError) as error:
                raise InputError(f"{name}: incomplete ({error!r}); run the command that wrote it again") from error
    page.heading("Machine and input")
    for name, content in results:
        machine = content.get("machine", {})
        versions = " ".join(f"{k} {v}" for k, v in machine.get("versions", {}).items())
        page.note(
            f"{name}: {machine.get('cpu')}, {machine.get('cores')} cores, Python {machine.get('python')}, "
            f"{versions}, commit {machine.get('commit')}, fingerprint {content.get('fingerprint')}"
        )
        if "command" in content:
            page.code(content["command"])
    page.write_markdown(folder / "index.md")
    return page.write(folder / "index.html")


def _kind(name: str, content: dict) -> str:
    for kind, experiment in EXPERIMENTS.items():
        if all(key in content for key in experiment.keys):
            return kind
    raise InputError(f"{name}: not a result of {', '.join(EXPERIMENTS)}")


def _add_section(page: Page, kind: str, content: dict, stem: Path) -> None:
    experiment = EXPERIMENTS[kind]
    page.heading(written(experiment.heading, content))
    if about := written(experiment.about, content):
        page.note(about)
    for title, table in experiment.tables(content):
        if title:
            page.heading(title)
        on_page(page, table)
    if notes := experiment.notes(content):
        page.note("; ".join(notes))
    for picture in _PICTURES[kind](content) if kind in _PICTURES else ():
        if isinstance(picture, str):
            page.note(picture)
            continue
        name, caption, what = picture
        path = stem.with_name(f"{stem.name}{name}.png")
        if isinstance(what, Figure):
            save(what, path)
        else:
            with atomic_path(path) as temporary:
                Image.fromarray(what).save(temporary)
        page.picture(path, caption)


def _evaluation(content: dict) -> Pictures:
    yield ("", "Final errors over all trials", final_error_figure(content["trials"]))
    for sequence in content["sequences"]:
        name = sequence["sequence"]
        own = [t for t in content["trials"] if t["sequence"] == name]
        stem = re.sub(r"[^0-9A-Za-z]+", "_", name)
        figure = trial_error_figure(f"{name}, {len(own)} trials", own)
        yield (f"_{stem}_errors", f"{name}, init {content['config']['init']}: errors over the frames", figure)
        if Path(sequence["mesh"]).is_file():
            caption = "true path (green) and published poses of the second half of every trial (red)"
            yield (f"_{stem}_paths", f"{name}: {caption}", _paths(sequence, own))
        else:
            yield f"no picture of the paths: the mesh {sequence['mesh']} is not there"


def _paths(sequence: dict, trials: list[dict]) -> np.ndarray:
    """Draw the true path and the published poses on the mesh, (H, W, 3) uint8."""
    truth = se3.from_xyzquat(np.array(sequence["truth"]))
    estimates = []
    for trial in trials:
        # only the second half: in the first the filter still searches
        if known := [row for row in trial["per_frame"]["estimate"] if row is not None]:
            estimates.append(se3.from_xyzquat(np.array(known[len(known) // 2 :])))
    return ObjectView(ObjectMesh.load(sequence["mesh"]), truth, 900).paths(truth, estimates)


def _benchmark(content: dict) -> Pictures:
    for init in content["summary"].get(DEFAULT, {}):
        trials = [t for t in content["trials"] if t["variant"] == DEFAULT and t["init"] == init]
        yield (f"_{init}_errors", f"Start {init}: final errors", final_error_figure(trials))
    if len(content["variants"]) > 1 and content["comparison"]:
        caption = "Error against the filter's CPU time per frame; the line joins what no other variant beats in both"
        yield ("_front", caption, front_figure(content["comparison"], content["variants"]))


_PICTURES: dict[str, Callable[[dict], Pictures]] = {
    "evaluate": _evaluation,
    "benchmark": _benchmark,
    "evaluate-perception presses": presses.pictures,
    "single-touch": single_touch.pictures,
}
