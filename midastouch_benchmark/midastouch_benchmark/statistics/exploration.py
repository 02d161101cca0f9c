"""Figures of closed-loop trials: how often they end right, and after how far."""

from __future__ import annotations

import numpy as np

from .intervals import ENOUGH, Figures


def summarise_exploration(trials: list[dict]) -> dict[str, dict]:
    """By policy, over all trials and by object, fractions and medians with their 95 % intervals.

    trials; fractions that end converged and `right`, converged and `wrong`, said to be `alike`, and `alike_truly`, of
    the latter those with the truth among the places; rivalled, fraction in which another place competed with the true
    one, and of these `told_apart`, those that end right, and `said_alike`, those in which it was said that nothing
    tells places apart; path_m, median until converged and right, infinite for all others; asked_ms, CPU time that no
    answer takes longer than in 95 % of the trials; path_ratio, of the median path to that of `random`.
    """
    policies = {name: [t for t in trials if t["policy"] == name] for name in dict.fromkeys(t["policy"] for t in trials)}
    out = {}
    for name, some in policies.items():
        objects = {each: [t for t in some if t["object"] == each] for each in dict.fromkeys(t["object"] for t in some)}
        out[name] = _figures(some) | {"objects": {each: _figures(part) for each, part in objects.items()}}
    base = out.get("random", {}).get("path_m", {}).get("value")
    for one in out.values():
        path = one["path_m"]["value"]
        one["path_ratio"] = path / base if base and np.isfinite(base) else None
    return out


def _figures(trials: list[dict]) -> dict:
    figures = Figures([(t["object"], t["seed"]) for t in trials])
    converged = [t["ending"] == "converged" for t in trials]
    right = [c and t["right"] for c, t in zip(converged, trials, strict=True)]
    alike = [t["ending"] == "alike" for t in trials]
    rivalled = [bool(t["rivalled"]) for t in trials]
    named = [a and t["truth_among_places"] for a, t in zip(alike, trials, strict=True)]
    paths = np.array([t["path_m"] if r else np.inf for r, t in zip(right, trials, strict=True)])

    def of_rivalled(part: list[bool]) -> dict:
        return figures.fraction([a and b for a, b in zip(rivalled, part, strict=True)], [int(a) for a in rivalled])

    asked = [t["asked_ms"][1] for t in trials if t["asked_ms"]]
    return {
        "trials": len(trials),
        "enough": len(trials) >= ENOUGH,
        "right": figures.fraction(right),
        "wrong": figures.fraction([c and not r for c, r in zip(converged, right, strict=True)]),
        "alike": figures.fraction(alike),
        "alike_truly": figures.fraction(named, [int(a) for a in alike]),
        "rivalled": figures.fraction(rivalled),
        "told_apart": of_rivalled(right),
        "said_alike": of_rivalled(alike),
        "path_m": figures.value(paths, np.median),
        "asked_ms": float(np.quantile(asked, 0.95)) if asked else None,
    }
