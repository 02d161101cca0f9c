"""The pictures of docs/trust.md from the committed reports.

.venv/bin/python -m midastouch_benchmark.tables.trust_plots

Each PNG holds, as text, a digest of the numbers that it shows, so that a test can tell whether it is of the newest
reports.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
from matplotlib import colormaps
from matplotlib.figure import Figure

from midastouch_common.files import atomic_path

from ..statistics.intervals import ENOUGH
from .reports import ROOT, benchmark_summary, report, reported
from .trust import PROMISED_WRONG, conditions

FOLDER = ROOT / "docs" / "images"
DIGEST = "Shown"
"""Key of the digest in the PNG."""

_BARS = {"lw": 0, "marker": "o", "elinewidth": 1.4, "capsize": 2}
_POINT = "#4a5260"
_TOO_MANY = "#f6dedb"


def shown() -> dict[str, dict]:
    """By condition, what the reports with trials enough say: levels and the fraction of frames whose region of that
    level holds the truth, by kind of frame; fraction of converged frames that are wrong; each with intervals."""
    out, there = {}, reported()
    for name, what in conditions().items():
        if name not in there:
            continue
        summary = benchmark_summary(name)
        one = summary["trust"]
        if one["trials"] < ENOUGH:
            continue
        out[what] = {
            "levels": report(name)["levels"],
            "observed": {kind: summary["coverage"][kind]["observed"] for kind in one["regions"]},
            "regions": one["regions"],
            "wrong": one["converged_frames_wrong"],
        }
    return out


def digest(content: dict) -> str:
    """Of everything that the pictures show."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:16]


def regions_figure(content: dict[str, dict]) -> Figure:
    """Measured over nominal fraction of frames whose region holds the truth, one line per condition; intervals at the
    levels of the tables. On the diagonal the covariance means what it says, below it is too small."""
    figure = Figure(figsize=(11, 5.4), layout="constrained")
    titles = {"converged": "state `converged`", "right": "right pose, whatever the state"}
    for axes, (kind, title) in zip(figure.subplots(1, 2, sharey=True), titles.items(), strict=True):
        axes.plot([0, 1], [0, 1], color="#9aa1ab", lw=1, ls="--", zorder=0)
        for k, (what, one) in enumerate(content.items()):
            if one["observed"][kind][0] is None:
                continue
            colour = _colour(k)
            axes.plot([0, *one["levels"]], [0, *one["observed"][kind]], color=colour, lw=1.6, label=what)
            levels, fractions, errors = _intervals(one["regions"][kind])
            axes.errorbar(levels, fractions, errors, color=colour, ms=3, **_BARS)
        axes.set_title(title, fontsize=10)
        axes.set_xlabel("nominal share", fontsize=9)
        axes.set_xlim(0, 1)
        axes.set_ylim(0, 1.01)
        _plain(axes)
    figure.axes[0].set_ylabel("share of frames whose region holds the truth", fontsize=9)
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=8)
    return figure


def wrong_figure(content: dict[str, dict]) -> Figure:
    """Fraction of converged frames that are wrong by condition, with its interval; shaded: more than is promised."""
    kept = {what: one["wrong"] for what, one in content.items() if one["wrong"]["interval"]}
    figure = Figure(figsize=(9, 0.36 * len(kept) + 1.1), layout="constrained")
    axes = figure.subplots()
    rows = np.arange(len(kept))[::-1]
    fractions = 100 * np.array([one["share"] for one in kept.values()])
    low, high = 100 * np.array([one["interval"] for one in kept.values()]).reshape(-1, 2).T
    promised = 100 * PROMISED_WRONG
    axes.axvspan(promised, 100, color=_TOO_MANY, lw=0, zorder=0)
    axes.errorbar(fractions, rows, xerr=np.maximum([fractions - low, high - fractions], 0), color=_POINT, ms=5, **_BARS)
    axes.set_yticks(rows, list(kept), fontsize=9)
    axes.set_xscale("symlog", linthresh=promised)  # linear as far as the promise; the wrong object is at 100
    axes.set_xticks(ticks := [0, 1, 2, 3, 4, 5, 10, 20, 50, 100], ticks)
    axes.set_xlim(0, 102)
    axes.set_xlabel("converged frames at a wrong pose, %, with 95 % interval", fontsize=9)
    _plain(axes)
    return figure


def _intervals(regions: dict[str, dict]) -> tuple[list[float], list[float], np.ndarray]:
    """Levels (L,), fractions (L,), and how far their intervals reach down and up (2, L)."""
    fractions = np.array([one["share"] for one in regions.values()])
    low, high = np.array([one["interval"] for one in regions.values()]).T
    return [float(level) for level in regions], fractions.tolist(), np.maximum([fractions - low, high - fractions], 0)


def _colour(number: int) -> tuple:
    return colormaps["tab20"](number % 20)


def _plain(axes) -> None:
    axes.grid(color="#eceef1", lw=0.7)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=8)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


FIGURES = {"trust_regions.png": regions_figure, "trust_converged.png": wrong_figure}


def write(folder: Path) -> None:
    """Draw all pictures into a folder."""
    content = shown()
    for name, draw in FIGURES.items():
        with atomic_path(folder / name) as temporary:
            # no name of the library: the same numbers give the same file
            draw(content).savefig(
                temporary, format="png", dpi=110, metadata={DIGEST: digest(content), "Software": None}
            )


if __name__ == "__main__":
    write(FOLDER)
