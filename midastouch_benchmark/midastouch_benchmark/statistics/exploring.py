"""Figures of exploration, identification and the ideal observer: how often right, and after how long a path."""

from __future__ import annotations

from collections import Counter

import numpy as np

from .intervals import ENOUGH, Figures

TOO_DEEP_MM = 1.5
"""Depth [mm] from which an object in a gel may harm it."""


def too_deep(depths: list[float]) -> str:
    """Return in words how many of some depths [mm] are larger than `TOO_DEEP_MM`."""
    return f"{sum(depth > TOO_DEEP_MM for depth in depths)} of {len(depths)}"


def summarise_exploration(trials: list[dict]) -> dict[str, dict]:
    """Return figures by policy, over all trials and by object; fractions and medians have 95 % intervals.

    trials: their number; right: fraction that ends with the right answer; wrong: that ends converged with a wrong one;
    alike: that ends with hypotheses that nothing tells apart; path_m: median until right, infinite for all others;
    asked_ms: 95 % quantile over trials of the CPU time of the slowest answer; seconds: of an arm, as path_m;
    indented_mm: of an arm, the largest of all trials; too_deep: how many of them pressed their gel in by more than
    `TOO_DEEP_MM`; deep_along: the same along the gel's axis;
    path_ratio: median path over that of `random`.
    """
    policies = {name: [t for t in trials if t["policy"] == name] for name in dict.fromkeys(t["policy"] for t in trials)}
    out = {}
    for name, some in policies.items():
        objects = {each: [t for t in some if t["object"] == each] for each in dict.fromkeys(t["object"] for t in some)}
        out[name] = _of_policy(some) | {"objects": {each: _of_policy(part) for each, part in objects.items()}}
    base = out.get("random", {}).get("path_m", {}).get("value")
    for one in out.values():
        path = one["path_m"]["value"]
        one["path_ratio"] = path / base if base and np.isfinite(base) else None
    return out


def _of_policy(trials: list[dict]) -> dict:
    figures = Figures.by_seed(trials)
    converged = [t["ending"] == "converged" for t in trials]
    right = [t["right"] and t["ending"] in ("converged", "another object") for t in trials]
    alike = [t["ending"] == "alike" for t in trials]
    paths = np.array([t["path_m"] if r else np.inf for r, t in zip(right, trials, strict=True)])
    asked = [t["asked_ms"][1] for t in trials if t["asked_ms"]]
    indented, depths = ([t[key] for t in trials if t.get(key)] for key in ("indented_mm", "deepest_mm"))
    timed = any(t.get("seconds") for t in trials)
    seconds = np.array([t.get("seconds") if r else np.inf for r, t in zip(right, trials, strict=True)], float)
    return {
        "trials": len(trials),
        "enough": len(trials) >= ENOUGH,
        "right": figures.fraction(right),
        "wrong": figures.fraction([c and not r for c, r in zip(converged, right, strict=True)]),
        "alike": figures.fraction(alike),
        "path_m": figures.value(paths, np.median),
        "asked_ms": float(np.quantile(asked, 0.95)) if asked else None,
        "seconds": figures.value(seconds, np.median) if timed else None,
        "indented_mm": max(indented, default=None),
        "too_deep": too_deep(indented) if indented else None,
        "deep_along": too_deep(depths) if depths else None,
    }


_BINS = 10


def summarise_identification(trials: list[dict]) -> dict:
    """Return figures over all trials, as {"share" or "value", "interval"}, and the numbers of trials behind them.

    known, unknown: numbers of trials with the object in the catalogue and without; right: known objects named right at
    the end; pose_right, alone_pose_right: right poses of known objects, and of the filter that is given the object;
    refused: unknown objects that are refused; path_until_right [m]: median of known objects, infinite if half never are
    right; calibration_error: expected calibration error of all answers, at the end and on the way; cpu_ratio: mean CPU
    of a frame over that of the filter that is given the object; answers: `confusions`; enough: for a claim.
    """
    known = [trial for trial in trials if trial["in_catalogue"]]
    unknown = [trial for trial in trials if not trial["in_catalogue"]]
    of_known = Figures.by_slide(known)
    return {
        "known": len(known),
        "unknown": len(unknown),
        "objects": len({trial["object"] for trial in trials}),
        "enough": min(len(known), len(unknown)) >= ENOUGH,
        "right": of_known.fraction([trial["right"] for trial in known]),
        "pose_right": of_known.fraction([trial["pose_right"] for trial in known]),
        "alone_pose_right": of_known.fraction([trial["alone_pose_right"] for trial in known]),
        "refused": Figures.by_slide(unknown).fraction([trial["right"] for trial in unknown]),
        "path_until_right": of_known.value(
            [np.inf if t["right_from_m"] is None else t["right_from_m"] for t in known], np.median
        ),
        "calibration_error": calibration_error(
            [tuple(each[1:]) for t in trials for each in (*t["asked"], (0.0, t["confidence"], t["right"]))]
        ),
        "cpu_ratio": of_known.value([t["cpu_ms"] / t["alone_cpu_ms"] for t in known], np.mean),
        "answers": confusions(trials),
    }


def calibration_error(answers: list[tuple[float, bool]]) -> float | None:
    """Return the expected calibration error of answers, (probability, whether it is right) each (Guo et al. 2017)."""
    if not answers:
        return None
    confidence, right = (np.array(column, float) for column in zip(*answers, strict=True))
    index = np.minimum((confidence * _BINS).astype(int), _BINS - 1)
    gap = np.bincount(index, confidence, _BINS) - np.bincount(index, right, _BINS)
    return float(np.abs(gap).sum() / len(answers))


def confusions(trials: list[dict]) -> dict[str, int]:
    """Return the wrong answers at the end, "truth -> answer", with their numbers, the most frequent first."""
    wrong = [t for t in trials if not t["right"]]
    names = [f"{t['object']}{'' if t['in_catalogue'] else ' (left out)'} -> {t['answer']}" for t in wrong]
    return dict(Counter(names).most_common())


def summarise_observing(trials: list[dict], evidence: tuple[str, ...], spacing: float) -> dict[str, dict]:
    """Return, for each kind of evidence of the observer, its figures as {"share" or "value", "interval"}.

    spacing [m]: path between two keyframes; shorter paths count as this.

    known, filter_known: fractions of slides at whose end, or before whose event, observer or filter knows the pose;
    only_observer, only_filter: the other one does not. path_m, filter_path_m: median path until it is known, infinite
    if half never know; path_ratio: median of the filter's path over the observer's, of the slides on which the observer
    knows. soon, filter_soon: fractions that know again some frames after the event; again_ratio: as path_ratio, from
    the event on. sure_right, filter_sure_right: fractions of the sure answers that are right; calibration_error: of all
    the observer's answers.
    """
    return {name: _of_evidence(trials, name, spacing) for name in evidence}


def _of_evidence(trials: list[dict], name: str, spacing: float) -> dict:
    figures = Figures.by_slide(trials)
    own, its = [t["observers"][name] for t in trials], [t["filter"] for t in trials]
    path, filter_path = (_paths(each, "known_m", spacing) for each in (own, its))
    known, filter_known = np.isfinite(path), np.isfinite(filter_path)
    answers = (each["answers"] for each in own)
    reported = [pair for each in answers for pair in zip(each["probability"], each["right"], strict=True)]

    def soon(some: list[dict]) -> dict:
        asked = [each["known_soon"] is not None for each in some]
        return figures.fraction([bool(each["known_soon"]) for each in some], asked)

    def sure_right(some: list[dict]) -> dict:
        return figures.fraction([each["sure_right"] for each in some], [each["sure"] for each in some])

    return {
        "trials": len(trials),
        "enough": len(trials) >= ENOUGH,
        "known": figures.fraction(known),
        "filter_known": figures.fraction(filter_known),
        "only_observer": figures.fraction(known & ~filter_known),
        "only_filter": figures.fraction(filter_known & ~known),
        "path_m": figures.value(path, np.median),
        "filter_path_m": figures.value(filter_path, np.median),
        "path_ratio": figures.value(_ratio(filter_path, path), np.median),
        "soon": soon(own),
        "filter_soon": soon(its),
        "again_ratio": figures.value(_ratio(*(_paths(each, "again_m", spacing) for each in (its, own))), np.median),
        "sure_right": sure_right(own),
        "filter_sure_right": sure_right(its),
        "calibration_error": calibration_error(reported),
    }


def _paths(some: list[dict], key: str, spacing: float) -> np.ndarray:
    """Return the paths [m] (N,) until the pose is known, infinite if it never is."""
    return np.array([np.inf if each[key] is None else max(each[key], spacing) for each in some])


def _ratio(path: np.ndarray, of_observer: np.ndarray) -> np.ndarray:
    """Return the paths over those of the observer (N,), nan if the observer never knows."""
    known = np.isfinite(of_observer)
    return np.where(known, path / np.where(known, of_observer, 1.0), np.nan)
