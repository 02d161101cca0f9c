"""Page that `midastouch report` makes of result files."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from PIL import Image

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.files import atomic_path
from midastouch_common.mesh import ObjectMesh
from midastouch_tools.drawing.figures import MODE_COLOUR, save, style_error_axes
from midastouch_tools.drawing.object_view import ObjectView
from midastouch_tools.drawing.page import Page

from ..speed.scaling import USUAL
from ..tables.accuracy import objects, real_row
from ..tables.checks import check_tables
from ..tables.perception import depth_table
from ..tables.results import of_identification
from ..tables.speed import rates, scaling_table, stages
from ..tables.table import on_page
from .accuracy import accuracy_section
from .presses import press_section
from .single_touch import single_touch_section
from .trial_figures import final_error_figure, stage_figure, trial_error_figure


def write_results_page(results: list[tuple[str, dict]], folder: str | os.PathLike) -> Path:
    """Write a page on (file name, content) pairs into `folder`, as `index.html` and `index.md` with their pictures.

    Files of the same command go into one section. Returns the path of `index.html`. Raises InputError for a file of an
    unknown command, or an incomplete one.
    """
    folder = Path(folder)
    by_kind: dict[Callable, list[dict]] = {}
    for name, content in results:
        by_kind.setdefault(_section(name, content), []).append(content)
    folder.mkdir(parents=True, exist_ok=True)
    page = Page("MidasTouch results")
    for section in (
        _evaluate, accuracy_section, _identification, _depth, press_section, _checks, single_touch_section,
        _speed, _scaling,
    ):  # fmt: skip
        if section in by_kind:
            try:
                section(page, by_kind[section], folder)
            except (KeyError, TypeError, IndexError) as error:
                names = ", ".join(name for name, content in results if _section(name, content) is section)
                raise InputError(f"{names}: incomplete ({error!r}); run the command that wrote it again") from error
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


def _section(name: str, content: dict) -> Callable:
    for key, section in (
        ("comparison", accuracy_section),
        ("identification", _identification),
        ("tdn_ms", _speed),
        ("scaling", _scaling),
        ("sequences", _evaluate if "trials" in content else _depth),
        ("presses", press_section),
        ("fit_check", _checks),
        ("queries", single_touch_section),
    ):
        if key in content:
            return section
    raise InputError(
        f"{name}: not a result of evaluate, benchmark, identify, evaluate-tdn, evaluate-presses, evaluate-checks, "
        "single-touch, bench or bench-scale: of the other commands there is no page"
    )


def _evaluate(page: Page, contents: list[dict], folder: Path) -> None:
    page.heading("Localisation")
    for content in contents:
        config = content["config"]
        page.note(
            f"init {config['init']}, beta {config['beta']:g}, {config['seeds']} seeds, "
            f"stride {config['stride']}; networks {config['networks']['tdn']}, {config['networks']['tcn']}"
        )
        on_page(page, objects(content["summary"], beside=real_row(content)))
    trials = [trial for content in contents for trial in content["trials"]]
    page.picture(save(final_error_figure(trials), folder / "final_errors.png"), "Final errors over all trials")
    for number_of_file, content in enumerate(contents):
        for sequence in content["sequences"]:
            own = [t for t in content["trials"] if t["sequence"] == sequence["sequence"]]
            page.heading(f"{sequence['sequence']}, init {content['config']['init']}")
            stem = f"{number_of_file}_{re.sub(r'[^0-9A-Za-z]+', '_', sequence['sequence'])}"
            figure = trial_error_figure(f"{sequence['sequence']}, {len(own)} trials", own)
            page.picture(save(figure, folder / f"{stem}_errors.png"), "Errors over the frames")
            _paths(page, sequence, own, folder / f"{stem}_paths.png")


def _paths(page: Page, sequence: dict, trials: list[dict], path: Path) -> None:
    """Add a picture of the true path and the published poses on the mesh; without the mesh, a note."""
    if not Path(sequence["mesh"]).is_file():
        page.note(f"no picture of the paths: the mesh {sequence['mesh']} is not there")
        return
    truth = se3.from_xyzquat(np.array(sequence["truth"]))
    view = ObjectView(ObjectMesh.load(sequence["mesh"]), truth, 900)
    estimates = []
    for trial in trials:
        known = [row for row in trial["per_frame"]["estimate"] if row is not None]
        # only the second half: in the first the filter still searches
        if known:
            estimates.append(se3.from_xyzquat(np.array(known[len(known) // 2 :])))
    with atomic_path(path) as temporary:
        Image.fromarray(view.paths(truth, estimates)).save(temporary)
    page.picture(path, "True path (green) and published poses of the second half of every trial (red)")


def _depth(page: Page, contents: list[dict], folder: Path) -> None:
    page.heading("Depth network")
    for content in contents:
        on_page(page, depth_table(content))


def _speed(page: Page, contents: list[dict], folder: Path) -> None:
    page.heading("Speed")
    for i, content in enumerate(contents):
        page.note(f"{content['threads']} cores, codebook of {content['codebook_size']} poses")
        on_page(page, rates(content))
        on_page(page, stages(content))
        page.picture(save(stage_figure(content), folder / f"stages_{i}.png"), "Milliseconds per call")


def _checks(page: Page, contents: list[dict], folder: Path) -> None:
    page.heading("Checks on tactile images")
    for content in contents:
        page.note(
            f"network {content['network']}, sensor {content['sensor']}: {content['sensors']} imaginary sensors over "
            f"{content['no_contact_images']} real no-contact images; areas under the ROC curve are against the sensors "
            "that are right"
        )
        for table in check_tables(content):
            on_page(page, table)


def _identification(page: Page, contents: list[dict], folder: Path) -> None:
    page.heading("Which object")
    for content in contents:
        page.note(f"catalogue: {', '.join(content['catalogue'])}")
        for _, table in of_identification(content):
            on_page(page, table)
        wrong = content["identification"]["answers"]
        page.note("; ".join(f"{answer}: {times}" for answer, times in wrong.items()) or "every answer is right")


# varied number, constant number, label
_COLUMNS = ("particles", "poses", "hypotheses at the start"), ("poses", "particles", "codebook poses")


def _scaling(page: Page, contents: list[dict], folder: Path) -> None:
    for k, content in enumerate(contents):
        page.heading(f"Time and memory of the filter, on {content['object']}")
        page.note(f"{content['frames']} frames, {content['threads']} cores; nothing is known at the start")
        on_page(page, scaling_table(content["scaling"]))
        caption = f"The other number is {USUAL:,}. CPU time counts all threads"
        page.picture(save(scaling_figure(content["scaling"]), folder / f"scaling_{k}.png"), caption)


def scaling_figure(points: list[dict]) -> Figure:
    """Plot CPU time of a step and memory, each over hypotheses and over poses, all logarithmic."""
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
