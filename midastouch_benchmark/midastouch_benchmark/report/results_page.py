"""Page that `midastouch report` makes of result files: for each the tables that its command prints, and pictures."""

from __future__ import annotations

import os
import re
from pathlib import Path

from matplotlib.figure import Figure
from PIL import Image

from midastouch_common.errors import InputError
from midastouch_common.files import whole_folder
from midastouch_tools.drawing.figures import save
from midastouch_tools.drawing.page import Page

from ..tables.experiments import EXPERIMENTS, written
from ..tables.table import on_page
from .pictures import PICTURES


def write_results_page(results: list[tuple[str, dict]], folder: str | os.PathLike) -> Path:
    """Write a page on (file name, content) pairs into `folder`, as `index.html` and `index.md` with their pictures.

    They take the place of an earlier page all at once. Returns the path of `index.html`. Raises InputError for a file
    of an unknown command, or an incomplete one.
    """
    kinds = [_kind(name, content) for name, content in results]
    with whole_folder(folder) as fresh:
        page = Page("MidasTouch results")
        for kind in EXPERIMENTS:
            some = [result for result, each in zip(results, kinds, strict=True) if each == kind]
            for number, (name, content) in enumerate(some):
                stem = f"{re.sub(r'[^a-z]+', '_', kind)}_{number}"
                try:
                    _add_section(page, kind, content, fresh / stem)
                except (KeyError, TypeError, IndexError) as error:
                    raise InputError(f"{name}: incomplete ({error!r}); run the command that wrote it again") from error
        _add_machines(page, results)
        page.write_markdown(fresh / "index.md")
        page.write(fresh / "index.html")
    return Path(folder) / "index.html"


def _add_machines(page: Page, results: list[tuple[str, dict]]) -> None:
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
    for picture in PICTURES[kind](content) if kind in PICTURES else ():
        if isinstance(picture, str):
            page.note(picture)
            continue
        name, caption, what = picture
        path = stem.with_name(f"{stem.name}{name}.png")
        if isinstance(what, Figure):
            save(what, path)
        else:
            Image.fromarray(what).save(path)
        page.picture(path, caption)
