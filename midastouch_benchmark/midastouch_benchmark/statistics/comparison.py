"""Variants against the default on the same trials: error, run time, the Pareto front of both."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from ..trials.variants import DEFAULT
from .accuracy import final_errors, is_right, wrong_converged
from .intervals import ENOUGH, bootstrap_interval, identity


def compare_variants(trials: list[dict]) -> list[dict]:
    """Return one row per init and variant; all rows of an init are over the trials that every variant has run.

    Differences to the default are taken trial by trial, each with its 95 % `_interval` over slides (None with a single
    slide): `difference_mm`, of the mean final particle error; `right_difference`, of the fraction right at the end;
    `wrong_converged_difference`, of the mean fraction of frames converged wrong; `cpu_difference_ms`, of the filter's
    mean CPU time a frame. `verdict`: in which of them it is `worse`, in which `better`.
    """
    by_variant: dict[tuple[str, str], dict[tuple, dict]] = {}
    for trial in trials:
        group = by_variant.setdefault((trial["init"], trial["variant"]), {})
        group[identity(trial)] = trial
    rows = []
    for init in dict.fromkeys(init for init, _ in by_variant):
        groups = {variant: group for (where, variant), group in by_variant.items() if where == init}
        if DEFAULT not in groups:
            continue
        everywhere = set.intersection(*map(set, groups.values()))
        for variant, group in groups.items() if everywhere else ():
            one, default = ([each[key] for key in sorted(everywhere)] for each in (group, groups[DEFAULT]))
            rows.append({"init": init, "variant": variant} | _row(one, default))
    return rows


def _row(trials: list[dict], default: list[dict]) -> dict:
    one = {
        "trials": len(trials),
        **{key: float(np.nanmean(final_errors(trials, key))) for key in ("e_trans_mm", "e_rot_deg")},
        "right": sum(map(is_right, trials)) / len(trials),
        "wrong_converged": wrong_converged(trials),
        "cpu_ms_filter": float(np.mean([t["filter_cpu_ms"] for t in trials])),
    }
    groups = [(t["object"], t["slide"]) for t in trials]
    differences: dict[str, float | list[float]] = {}
    for name, (_, _, figure) in _PAIRED.items():
        of_trials = figure(trials) - figure(default)
        known = of_trials[np.isfinite(of_trials)]
        differences[name] = float(known.mean()) if len(known) else None
        differences[f"{name}_interval"] = bootstrap_interval(of_trials, groups)
    row = one | differences
    return row | {"verdict": verdict(row)}


SAME_TIME = 0.25
"""Fraction of the default's CPU time by which a variant may differ and still count as equally fast: trials of a report
may have run hours apart, while the machine did other work, which can make a fifth."""


def verdict(row: Mapping) -> str:
    """Return text on the figures in which a row is shown to be worse or better; "too few" below `ENOUGH` trials."""
    if row["trials"] < ENOUGH:
        return f"too few ({row['trials']:.0f})"
    found: dict[str, list[str]] = {"worse": [], "better": []}
    for name, (what, sign, _) in _PAIRED.items():
        low, high = sorted(sign * bound for bound in row[f"{name}_interval"] or (0, 0))
        if name == "cpu_difference_ms":
            alike = SAME_TIME * (row["cpu_ms_filter"] - row["cpu_difference_ms"])
            low, high = low - alike, high + alike
        found["worse"] += [what] * (low > 0)
        found["better"] += [what] * (high < 0)
    return "; ".join(f"{how}: {', '.join(some)}" for how, some in found.items() if some) or "no difference shown"


_PAIRED: dict[str, tuple[str, int, Callable[[list[dict]], np.ndarray]]] = {
    "difference_mm": ("error", 1, lambda trials: final_errors(trials, "e_trans_mm")),
    "right_difference": ("right", -1, lambda trials: np.array(list(map(is_right, trials)), float)),
    "wrong_converged_difference": (
        "converged wrong", 1, lambda trials: np.array([wrong_converged([trial]) for trial in trials])
    ),
    "cpu_difference_ms": ("CPU time", 1, lambda trials: np.array([trial["filter_cpu_ms"] for trial in trials])),
}  # fmt: skip
"""Differences to the default: text of a verdict, 1 if more is worse (-1: better), and the figure of each trial (N,)."""


def pareto_front(rows: list[dict], error: str) -> list[dict]:
    """Return the rows that no other beats in both the filter's CPU time and an error, fastest first."""
    front: list[dict] = []
    for row in sorted(rows, key=lambda r: (r["cpu_ms_filter"], r[error])):
        if not front or row[error] < front[-1][error]:
            front.append(row)
    return front


def rows_by_init(rows: list[dict]) -> dict[str, list[dict]]:
    """Return rows of `compare_variants` by their init."""
    return {init: [row for row in rows if row["init"] == init] for init in dict.fromkeys(row["init"] for row in rows)}
