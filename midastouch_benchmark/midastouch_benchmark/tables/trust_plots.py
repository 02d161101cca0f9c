"""Pictures of docs/trust.md from the committed reports.

.venv/bin/python -m midastouch_benchmark.tables.trust_plots

Each PNG holds, as text, a digest of the numbers that it shows, so that a test can check that it shows the newest
reports.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from midastouch_common.files import atomic_path
from midastouch_tools.drawing.figures import style_axes

from ..statistics.intervals import ENOUGH
from .reports import ROOT, benchmark_summary, report, stale
from .trust import PROMISED_REGION, PROMISED_WRONG, conditions

FOLDER = ROOT / "docs" / "images"
DIGEST = "Shown"
"""Key of the digest in the PNG."""

_BARS: dict[str, Any] = {"lw": 0, "marker": "o", "elinewidth": 1.4, "capsize": 2}
_POINT = "#4a5260"
_COLOURS, _DASHES = colormaps["tab10"], ("-", "--", ":")
_OTHERS: dict[str, Any] = {"color": "#c3c8d0", "lw": 1.2, "zorder": 2, "label": "any other condition"}
_TOO_MANY = "#f6dedb"


def shown() -> dict[str, dict]:
    """Return the numbers of the pictures by condition, from today's reports of at least `ENOUGH` trials.

    observed: fraction of frames whose region of each of the `levels` holds the truth, by kind of frame; regions: the
    same with intervals, at the levels of the tables; wrong: fraction of converged frames that are wrong.
    """
    out, asked = {}, conditions()
    old = stale(asked)
    for name, what in asked.items():
        if name in old:
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
    """Return a digest of everything that the pictures show."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:16]


def regions_figure(content: dict[str, dict]) -> Figure:
    """Plot the measured over the nominal fraction of frames whose region holds the truth, a line for each condition.

    On the diagonal the covariance is right; below it, too small. Intervals stand at the levels of the tables.
    Conditions whose 95 % region is too small in either kind of frame have colours and names; the others are grey."""
    figure = Figure(figsize=(11, 5.4), layout="constrained")
    too_small = [what for what, one in content.items() if _too_small(one["regions"])]
    named: dict[str, dict[str, Any]] = {
        what: {"color": _COLOURS(k % 10), "ls": _DASHES[k // 10 % 3], "lw": 1.8, "zorder": 3, "label": what}
        for k, what in enumerate(too_small)
    }
    titles = {"converged": "state `converged`", "right": "right pose, whatever the state"}
    for axes, (kind, title) in zip(figure.subplots(1, 2, sharey=True), titles.items(), strict=True):
        axes.plot([0, 1], [0, 1], color="#9aa1ab", lw=1, ls="--", zorder=0)
        for what, one in content.items():
            if one["observed"][kind][0] is None:
                continue
            style = named.get(what, _OTHERS)
            axes.plot([0, *one["levels"]], [0, *one["observed"][kind]], **style)
            levels, fractions, errors = _intervals(one["regions"][kind])
            axes.errorbar(levels, fractions, errors, color=style["color"], ms=3, zorder=style["zorder"], **_BARS)
        axes.set_title(title, fontsize=10)
        axes.set_xlim(0, 1)
        axes.set_ylim(0, 1.01)
        style_axes(axes, "", "nominal fraction")
    figure.axes[0].set_ylabel("fraction of frames whose region holds the truth", fontsize=9)
    lines = {str(line.get_label()): line for line in (Line2D([], [], **style) for style in (*named.values(), _OTHERS))}
    figure.legend(lines.values(), lines, loc="outside lower center", ncols=2, fontsize=8)
    return figure


def wrong_figure(content: dict[str, dict]) -> Figure:
    """Plot the fraction of wrong converged frames by condition, with its interval; shaded: more than is promised."""
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
    axes.set_xscale("symlog", linthresh=promised)  # linear up to the promise; the wrong object is at 100
    axes.set_xticks(ticks := [0, 1, 2, 3, 4, 5, 10, 20, 50, 100], list(map(str, ticks)))
    axes.set_xlim(0, 102)
    style_axes(axes, "", "converged frames at a wrong pose, %, with 95 % interval")
    return figure


def _intervals(regions: dict[str, dict]) -> tuple[list[float], list[float], np.ndarray]:
    """Return levels (L,), fractions (L,), and the lengths of their intervals below and above (2, L)."""
    fractions = np.array([one["share"] for one in regions.values()])
    low, high = np.array([one["interval"] for one in regions.values()]).T
    return [float(level) for level in regions], fractions.tolist(), np.maximum([fractions - low, high - fractions], 0)


def _too_small(regions: dict[str, dict]) -> bool:
    """Return whether the whole interval at the promised level is below it, in any kind of frame."""
    intervals = [one[str(PROMISED_REGION)]["interval"] for one in regions.values()]
    return any(interval is not None and interval[1] < PROMISED_REGION for interval in intervals)


FIGURES = {"trust_regions.png": regions_figure, "trust_converged.png": wrong_figure}


def write(folder: Path) -> None:
    """Draw all pictures into a folder."""
    content = shown()
    for name, draw in FIGURES.items():
        with atomic_path(folder / name) as temporary:
            # without the library's name and version, the same numbers give the same file
            draw(content).savefig(
                temporary, format="png", dpi=110, metadata={DIGEST: digest(content), "Software": None}
            )


if __name__ == "__main__":
    write(FOLDER)
