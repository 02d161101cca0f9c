"""Comparison of the filter with the ideal observer, which finds what could be known, on the same slides."""

from __future__ import annotations

import numpy as np

from .exploring import calibration_error
from .intervals import ENOUGH, Figures


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
