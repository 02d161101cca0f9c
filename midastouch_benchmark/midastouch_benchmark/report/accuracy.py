"""The section of `midastouch benchmark`: errors per object, variants against time, calibration."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from midastouch_bringup.drawing.figures import ESTIMATE_COLOUR, MODE_COLOUR, PARTICLE_COLOUR, save
from midastouch_bringup.drawing.page import Page

from ..statistics.accuracy_tables import (
    coverage_table,
    object_table,
    paper_text,
    peer_table,
    peers_of,
    recovery_text,
    trust_table,
)
from ..statistics.comparison import comparison_table, front_text, rows_by_init
from ..statistics.coverage import observed_shares
from ..trials.variants import DEFAULT
from .front import front_figure
from .trial_figures import final_error_figure

_KIND_STYLES = {
    "one_mode": {"color": MODE_COLOUR},
    "several_modes": {"color": PARTICLE_COLOUR},
    "converged": {"color": ESTIMATE_COLOUR},
    "right": {"color": "#2a8f4e"},
}


def accuracy_section(page: Page, contents: list[dict], folder: Path) -> None:
    """Tables and pictures of result files of `midastouch benchmark`."""
    for k, content in enumerate(contents):
        config = content["config"]
        page.heading(f"Accuracy over {len(content['objects'])} objects, protocol {config['protocol']}")
        page.note(
            f"{len(config['slides'])} slides of {config['slide_length_m']:g} m each, {len(config['seeds'])} seeds, "
            f"beta {config['beta']:g}, stride {config['stride']}, codebooks of {config['codebook_size']} poses, "
            f"{config['jobs']} processes; networks {config['networks']['tdn']}, {config['networks']['tcn']}; "
            f"{content['missing_trials']} trials missing"
        )
        for init, summary in content["summary"].get(DEFAULT, {}).items():
            _one_init(page, content, init, summary, folder / f"accuracy_{k}_{init}")
        _variants(page, content, folder / f"accuracy_{k}_front.png")
        _likelihood(page, content, folder / f"likelihood_{k}.png")


def _one_init(page: Page, content: dict, init: str, summary: dict, stem: Path) -> None:
    page.heading(f"Start: {init}")
    page.table(*object_table(summary, content["objects"]))
    if init == "paper":
        page.note(paper_text(summary))
    trials = [t for t in content["trials"] if t["variant"] == DEFAULT and t["init"] == init]
    page.picture(save(final_error_figure(trials), stem.with_name(f"{stem.name}_errors.png")), "Final errors")
    if summary["recovery"]:
        page.note(recovery_text(summary["recovery"]))
    if "trust" in summary:  # results of before 2026-11-22 have no intervals
        page.table(*trust_table(summary["trust"]))
    if len(peers := peers_of(content["summary"], init)) > 1:
        page.note("Methods on the same slides:")
        page.table(*peer_table(peers))
    page.table(*coverage_table(summary["coverage"]))
    curves = {
        (kind.replace("_", " ") + f" ({one['frames']} frames)"): (one["observed"], _KIND_STYLES[kind])
        for kind, one in summary["coverage"].items()
        if one["frames"]
    }
    figure = reliability_figure(content["levels"], curves, "mass of the published Gaussian around the pose")
    page.picture(save(figure, stem.with_name(f"{stem.name}_coverage.png")), "How often the truth lies within")


def _variants(page: Page, content: dict, path: Path) -> None:
    """Every variant against the default, if there are any."""
    comparison = content["comparison"]
    if len(content["variants"]) < 2 or not comparison:
        return
    page.heading("Run time against error")
    caption = "Error against the filter's CPU time per frame; the line joins what no other variant beats in both"
    page.picture(save(front_figure(comparison, content["variants"]), path), caption)
    for init, rows in rows_by_init(comparison).items():
        page.heading(f"Variants, start: {init}")
        page.note(f"All on the same {rows[0]['trials']} trials; {front_text(rows)}.")
        page.table(*comparison_table(rows, content["variants"]))


def _likelihood(page: Page, content: dict, path: Path) -> None:
    """Calibration of the likelihood of single touches, per object and over all."""
    counts = {one["object"]: one["likelihood_levels"] for one in content["objects"] if one["likelihood_levels"]}
    if not counts:
        return
    curves = {name: (observed_shares(one), {"lw": 1, "alpha": 0.7}) for name, one in counts.items()}
    total = np.sum(list(counts.values()), axis=0)
    curves[f"all ({total.sum()} touches)"] = observed_shares(total), {"color": "black", "lw": 2.2}
    page.heading("Calibration of the likelihood")
    figure = reliability_figure(content["levels"], curves, "mass of the codebook's likeliest poses given one touch")
    page.picture(save(figure, path), "How often the true pose is among them")


def reliability_figure(levels: list[float], curves: dict[str, tuple], label: str) -> Figure:
    """Observed share (L,) over predicted share `levels` (L,) of each curve, (shares, line style) by its name; the
    diagonal is perfect calibration."""
    figure = Figure(figsize=(7, 5), layout="constrained")
    axes = figure.subplots()
    axes.plot([0, 1], [0, 1], color="#c8ccd2", lw=1, zorder=0)
    for name, (observed, style) in curves.items():
        axes.plot([0, *levels], [0, *np.array(observed, float)], label=name, **style)
    axes.set_xlabel(f"predicted share: {label}", fontsize=9)
    axes.set_ylabel("observed share", fontsize=9)
    axes.set_xlim(0, 1)
    axes.set_ylim(0, 1)
    axes.grid(color="#eceef1", lw=0.7)
    axes.legend(frameon=False, fontsize=8, loc="upper left", bbox_to_anchor=(1, 1))
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    return figure
