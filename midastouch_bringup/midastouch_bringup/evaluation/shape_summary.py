"""Figures of catalogues of random shapes, each with its 95 % interval, and their table."""

from __future__ import annotations

import numpy as np

from .intervals import ENOUGH, bootstrap_interval, share_interval
from .shape_catalogues import EARLY


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
    return {
        "known": len(known),
        "unknown": len(unknown),
        "enough": len(known) >= ENOUGH,
        "compared_early": _share(known, [trial["early"]["compared"] for trial in known]),
        "leads_early": _share(known, [trial["early"]["leads"] for trial in known]),
        "compared": _share(known, [trial["late"]["compared"] for trial in known]),
        "leads": _share(known, [trial["late"]["leads"] for trial in known]),
        "right": _share(known, [trial["right"] for trial in known]),
        "refused": _share(unknown, [trial["right"] for trial in unknown]),
        "cpu_ms": {
            "value": float(np.mean([trial["cpu_ms"] for trial in trials])),
            "interval": bootstrap_interval([trial["cpu_ms"] for trial in trials], _groups(trials)),
        },
        "slowest_ms": max(trial["slowest_ms"] for trial in trials),
        "memory_mib": max(trial["memory_mib"] for trial in trials),
    }


def _groups(trials: list[dict]) -> list[tuple]:
    return [(trial["object"], trial["slide"]) for trial in trials]


def _share(trials: list[dict], part: list[bool]) -> dict:
    return {
        "share": float(np.mean(part)) if part else None,
        "interval": share_interval(part, np.ones(len(part)), _groups(trials)),
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
