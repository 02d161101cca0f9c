"""The page that `midastouch report` makes of result files."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
from PIL import Image

from midastouch_bringup.drawing.figures import save
from midastouch_bringup.drawing.object_view import ObjectView
from midastouch_bringup.drawing.page import Page
from midastouch_bringup.text_table import number
from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.files import atomic_path
from midastouch_common.mesh import ObjectMesh

from ..statistics.real_table import real_table
from .accuracy import accuracy_section
from .checks import check_section
from .identification import identification_section
from .presses import press_section
from .scaling import scaling_section
from .single_touch import single_touch_section
from .trial_figures import final_error_figure, stage_figure, trial_error_figure


def write_results_page(results: list[tuple[str, dict]], folder: str | os.PathLike) -> Path:
    """Write `index.html`, its pictures and the same as `index.md` for (file name, content) pairs into `folder`; returns
    the path of the first.

    Files of the same command go into one section. Raises InputError for a file of no known command.
    """
    folder = Path(folder)
    by_kind: dict[Callable, list[dict]] = {}
    for name, content in results:
        by_kind.setdefault(_section(name, content), []).append(content)
    folder.mkdir(parents=True, exist_ok=True)
    page = Page("MidasTouch results")
    for section in (
        _evaluate, accuracy_section, identification_section, _depth, press_section, check_section, single_touch_section,
        _speed, scaling_section,
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
            f"{versions}, commit {machine.get('commit')}"
        )
        if "command" in content:
            page.code(content["command"])
    page.write_markdown(folder / "index.md")
    return page.write(folder / "index.html")


def _section(name: str, content: dict) -> Callable:
    for key, section in (
        ("comparison", accuracy_section),
        ("identification", identification_section),
        ("tdn_ms", _speed),
        ("scaling", scaling_section),
        ("sequences", _evaluate if "trials" in content else _depth),
        ("presses", press_section),
        ("fit_check", check_section),
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
        page.table(*_trial_table(content["summary"]))
        if "paper_real" in content:
            page.table(*real_table(content["summary"]))
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


def _trial_table(summary: dict) -> tuple[list[str], list[list[object]]]:
    header = ["object", "trials", "initial mm", "deg", "particles mm (mean)", "deg"]
    header += [
        "closest mode mm (median)",
        "deg",
        "pose mm (median)",
        "deg",
        "converged",
        "Hz",
        "TDN ms",
        "TCN ms",
    ]
    header += ["filter ms"]
    rows = []
    for name, one in [*summary["objects"].items(), ("all", summary)]:
        row = [name, one["trials"], number(one["initial"]["e_trans_mm"]), number(one["initial"]["e_rot_deg"])]
        for prefix, statistic in (("e", "mean"), ("min_cluster", "median"), ("estimate", "median")):
            row += [number(one[f"{prefix}_{unit}"].get(statistic)) for unit in ("trans_mm", "rot_deg")]
        row += [
            one["converged"],
            number(one["hz_mean"]),
            *(number(one["ms"][s], 2) for s in ("tdn", "tcn", "filter")),
        ]
        rows.append(row)
    return header, rows


def _paths(page: Page, sequence: dict, trials: list[dict], path: Path) -> None:
    """The true path on the mesh with where the trials thought they were; a note without the mesh."""
    if not Path(sequence["mesh"]).is_file():
        page.note(f"no picture of the paths: the mesh {sequence['mesh']} is not there")
        return
    truth = se3.from_xyzquat(np.array(sequence["truth"]))
    view = ObjectView(ObjectMesh.load(sequence["mesh"]), truth, 900)
    estimates = []
    for trial in trials:
        known = [row for row in trial["per_frame"]["estimate"] if row is not None]
        # the path of the second half: the first still searches
        if known:
            estimates.append(se3.from_xyzquat(np.array(known[len(known) // 2 :])))
    with atomic_path(path) as temporary:
        Image.fromarray(view.paths(truth, estimates)).save(temporary)
    page.picture(path, "True path (green) and published poses of the second half of every trial (red)")


def _depth(page: Page, contents: list[dict], folder: Path) -> None:
    page.heading("Depth network")
    keys = ("rmse_mm", "contact_rmse_mm", "contact_iou", "ms_per_frame")
    for content in contents:
        rows = [[s["sequence"], s["frames"], *(number(s[k], 3) for k in keys)] for s in content["sequences"]]
        rows.append(["all", "", *(number(content["summary"][k], 3) for k in keys)])
        page.table(["sequence", "frames", "RMSE mm", "in contact mm", "contact IoU", "ms per frame"], rows)


def _speed(page: Page, contents: list[dict], folder: Path) -> None:
    page.heading("Speed")
    for i, content in enumerate(contents):
        page.note(
            f"{content['threads']} cores, codebook of {content['codebook_size']} poses: "
            f"{number(content['end_to_end_hz'])} Hz with 50,000 particles, "
            f"{number(content.get('converged_hz'))} Hz once converged; "
            f"{number(content['renders_per_s'], 0)} renders/s, "
            f"{number(content['codebook_poses_per_s'], 0)} codebook poses/s, "
            f"{number(content['peak_rss_mb'], 0)} MiB"
        )
        page.picture(save(stage_figure(content), folder / f"stages_{i}.png"), "Milliseconds per call")
