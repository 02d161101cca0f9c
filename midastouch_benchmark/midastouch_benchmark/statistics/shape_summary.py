"""Figures of catalogues of random shapes, each with its 95 % interval, and their table."""

from __future__ import annotations

import numpy as np

from ..trials.shape_catalogues import EARLY
from .intervals import ENOUGH, Figures


def summarise_shapes(trials: list[dict]) -> dict[str, dict]:
    """For each size of the catalogue: {"share" or "value", "interval"} of each figure, and what they are of.

    known, unknown: numbers of trials with the shape in the catalogue and without; of the former after `EARLY` m
    compared_early and leads_early: the shape was compared, no other one was more probable; compared and leads, likewise
    at the end; right, that it was more probable than `unknown`, too; refused, of the latter; cpu_ms of a frame, without
    the networks; slowest_ms, of all frames; memory_mib of the process, at most; enough: whether there are trials enough
    for a claim.
    """
    return {
        str(size): _summary([t for t in trials if t["size"] == size]) for size in sorted({t["size"] for t in trials})
    }


def _summary(trials: list[dict]) -> dict:
    known = [trial for trial in trials if trial["in_catalogue"]]
    unknown = [trial for trial in trials if not trial["in_catalogue"]]
    of_known = Figures.by_slide(known)
    return {
        "known": len(known),
        "unknown": len(unknown),
        "enough": len(known) >= ENOUGH,
        "compared_early": of_known.share([trial["early"]["compared"] for trial in known]),
        "leads_early": of_known.share([trial["early"]["leads"] for trial in known]),
        "compared": of_known.share([trial["late"]["compared"] for trial in known]),
        "leads": of_known.share([trial["late"]["leads"] for trial in known]),
        "right": of_known.share([trial["right"] for trial in known]),
        "refused": Figures.by_slide(unknown).share([trial["right"] for trial in unknown]),
        "cpu_ms": Figures.by_slide(trials).value([trial["cpu_ms"] for trial in trials], np.mean),
        "slowest_ms": max(trial["slowest_ms"] for trial in trials),
        "memory_mib": max(trial["memory_mib"] for trial in trials),
    }


def shape_table(summary: dict[str, dict]) -> tuple[list[str], list[list[str]]]:
    """Header and a row for each size of the catalogue; "too few" in place of shares below `ENOUGH` trials."""
    header = ["shapes", "slides", f"compared after {EARLY} m", "leads", "compared at the end", "leads", "right"]
    header += ["refused, left out", "CPU a frame, ms", "slowest, ms", "memory, MiB"]
    rows = []
    for size, one in summary.items():
        shares = [one[key] for key in ("compared_early", "leads_early", "compared", "leads", "right", "refused")]
        said = [_said(share) for share in shares] if one["enough"] else ["too few"] * len(shares)
        times = [f"{one['cpu_ms']['value']:.1f}", f"{one['slowest_ms']:.0f}", f"{one['memory_mib']:.0f}"]
        rows.append([size, str(one["known"]), *said, *times])
    return header, rows


def _said(share: dict) -> str:
    if share["share"] is None:
        return "-"
    return f"{share['share']:.0%} ({'...'.join(f'{bound:.0%}' for bound in share['interval'])})"
