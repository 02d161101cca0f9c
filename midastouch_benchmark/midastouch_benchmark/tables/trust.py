"""Tables of docs/trust.md: what the states promise, and how often it is kept."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

from midastouch_benchmark.statistics.coverage import WEIGHTS
from midastouch_filter.core.config import FilterConfig

from .cells import between, frames_cell, percent, share_cell
from .reports import (
    ENOUGH,
    OPTICS,
    PROTOCOLS,
    ROOT,
    STARTS,
    UNMEASURED,
    Table,
    benchmark_summary,
    held_out,
    report_path,
    reported,
)

_WEIGHED = {"accuracy": "start as the paper's", "tool_bias": "tool off", "kidnap": "moved untold"}
EVENTS = ("rest", "lift", "kidnap", "jump", "unexplained", "push")
"""Protocols in which something happens on the way."""
PROMISED_WRONG, PROMISED_REGION = 1 - FilterConfig().converged_probability, 0.95
"""What is promised: at most so many of the converged frames are wrong, and the 95 % region holds the truth."""


def conditions() -> dict[str, str]:
    """What trust is asked of: every protocol, and over ten further objects and real optics what there is."""
    optics = {name: f"light {what}" for name, what in OPTICS.items() if name != "real_plain"}
    there = {name: what for name, what in (held_out() | optics).items() if trusted(name)}
    return STARTS | PROTOCOLS | there


def trusted(name: str) -> dict | None:
    """What a report says of trust; None where there is none, or none with intervals (before 2026-11-22)."""
    one = benchmark_summary(name).get("trust") if name in reported() else None
    if one and "regions" not in one:
        mend = "run its command again; with the same --out it takes seconds"
        raise KeyError(f"{report_path(name).relative_to(ROOT)}: has no regions; {mend}")
    return one


def _trust_rows(names: dict[str, str], cells: Callable[[dict], list[str]], width: int) -> list[list[object]]:
    """One row for each report: what, cells of its trust, link."""
    rows = []
    for name, what in names.items():
        if (one := trusted(name)) is None:
            rows.append([what, UNMEASURED, *["-"] * width])
        else:
            few = [f"too few ({one['trials']})"] * width
            rows.append([what, *(cells(one) if one["trials"] >= ENOUGH else few), f"[{name}]"])
    return rows


def converged() -> Table:
    """How often the state `converged` is right."""

    def cells(one: dict) -> list[str]:
        wrong = one["converged_frames_wrong"]
        keys = ("right_if_converged_at_end", "right_if_converged_modulo_symmetry_at_end")
        words = ("kept", "*not kept*", "not shown")
        return [share_cell(wrong, 1), _verdict(wrong, PROMISED_WRONG, *words), *(share_cell(one[key]) for key in keys)]

    header = ["conditions", "of converged frames, wrong", f"at most {percent(PROMISED_WRONG)}"]
    header += ["of trials that end `converged`, right", "the same, counting a symmetric twin as right", "report"]
    return header, _trust_rows(conditions(), cells, 4)


def weights() -> Table:
    """How often a published pose is right, by the weight of its mode."""
    shown = {name: benchmark_summary(name)["trust"] for name in _WEIGHED if name in reported()}
    shown = {name: trust["weights"] for name, trust in shown.items() if trust["enough"] and "weights" in trust}
    rows = []
    for k, (low, high) in enumerate(pairwise([0.0, *WEIGHTS, 1.0])):
        bins = [weights[k] for weights in shown.values()]
        rows.append([f"{low:.0%} to {high:.0%}", *(share_cell(one["right"]) if one["frames"] else "-" for one in bins)])
    return ["weight of the published mode", *(f"right, {_WEIGHED[name]}" for name in shown)], rows


def regions() -> Table:
    """How often the published covariance holds the truth."""

    def cells(one: dict) -> list[str]:
        sure, right = (one["regions"][kind] for kind in ("converged", "right"))
        verdict = _verdict(sure["0.95"], PROMISED_REGION, "*too small*", "too large", "as said")
        return [*map(share_cell, sure.values()), verdict, *map(share_cell, right.values())]

    levels = ("50 %", "90 %", "95 %", "99 %")
    header = ["conditions", *(f"{level}, `converged`" for level in levels), "95 % region of `converged` frames"]
    return [*header, *(f"{level}, right" for level in levels), "report"], _trust_rows(conditions(), cells, 9)


def events() -> Table:
    """How long it takes until something that happened is noticed, and until the filter is right again."""

    def cells(one: dict) -> list[str]:
        frames, until = one["misled_frames"]["mean"], one["frames_until_right"]["median"]
        misled = "-" if frames["value"] is None else f"{frames['value']:.1f} ({between(frames['interval'], '{:.1f}')})"
        shares = [share_cell(one[key]) for key in ("right_before_event", "misled")]
        return [*shares, misled, share_cell(one["found_again"]), frames_cell(until)]

    header = ["event", "right before it", "of these, ever `converged` at a wrong place", "in how many frames, mean"]
    header += ["of these, right again after 30 frames", "frames until right again, median", "report"]
    return header, _trust_rows({name: PROTOCOLS[name] for name in EVENTS}, cells, 5)


def _verdict(one: dict, limit: float, below: str, above: str, undecided: str) -> str:
    """Which side of a limit a share is on, by its whole interval."""
    if one["interval"] is None:
        return "-"
    low, high = one["interval"]
    return below if high <= limit else above if low > limit else undecided
