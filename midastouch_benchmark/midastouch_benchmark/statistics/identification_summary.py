"""Figures of how well objects are told apart, each with its 95 % interval, and their table."""

from __future__ import annotations

import numpy as np

from .intervals import ENOUGH, Figures

_BINS = 10


def summarise_identification(trials: list[dict]) -> dict:
    """Over all trials: {"share" or "value", "interval"} of each figure, and what they are of.

    known, unknown: numbers of trials with the object in the catalogue and without; right, of the former, at the end;
    pose_right, likewise, and alone_pose_right, of the filter that knows the object; refused, of the latter;
    path_until_right [m], median of the former, infinite where half never are; calibration_error: expected calibration
    error of the answers at the end and on the way, of both; cpu_ratio: mean CPU of a frame over that of the filter
    which knows the object; answers: `confusions`; enough: whether there are trials enough for a claim.
    """
    known = [trial for trial in trials if trial["in_catalogue"]]
    unknown = [trial for trial in trials if not trial["in_catalogue"]]
    of_known = Figures.by_slide(known)
    return {
        "known": len(known),
        "unknown": len(unknown),
        "objects": len({trial["object"] for trial in trials}),
        "enough": min(len(known), len(unknown)) >= ENOUGH,
        "right": of_known.share([trial["right"] for trial in known]),
        "pose_right": of_known.share([trial["pose_right"] for trial in known]),
        "alone_pose_right": of_known.share([trial["alone_pose_right"] for trial in known]),
        "refused": Figures.by_slide(unknown).share([trial["right"] for trial in unknown]),
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
    """Expected calibration error of answers, each with its probability and whether it is right (Guo et al. 2017)."""
    if not answers:
        return None
    confidence, right = (np.array(column, float) for column in zip(*answers, strict=True))
    index = np.minimum((confidence * _BINS).astype(int), _BINS - 1)
    gap = np.bincount(index, confidence, _BINS) - np.bincount(index, right, _BINS)
    return float(np.abs(gap).sum() / len(answers))


def confusions(trials: list[dict]) -> dict[str, int]:
    """How often one was taken for another at the end: "truth -> answer" and number, most often first."""
    wrong = [t for t in trials if not t["right"]]
    names = [f"{t['object']}{'' if t['in_catalogue'] else ' (left out)'} -> {t['answer']}" for t in wrong]
    return dict(sorted(((name, names.count(name)) for name in dict.fromkeys(names)), key=lambda each: -each[1]))


def identification_table(summary: dict) -> tuple[list[str], list[list[object]]]:
    """Header and rows: what, figure, 95 % interval; "too few" in place of figures below `ENOUGH` trials."""
    rows = [
        ["right at the end", *_figure(summary["right"], "share", "{:.0%}")],
        ["and the pose converged within 10 mm", *_figure(summary["pose_right"], "share", "{:.0%}")],
        ["the same where the object is known", *_figure(summary["alone_pose_right"], "share", "{:.0%}")],
        ["refused, when left out of the catalogue", *_figure(summary["refused"], "share", "{:.0%}")],
        ["path until right, median, m", *_figure(summary["path_until_right"], "value", "{:.2f}")],
        ["expected calibration error", f"{summary['calibration_error']:.3f}", "-"],
        ["CPU a frame, over that of one known object", *_figure(summary["cpu_ratio"], "value", "{:.2f}")],
    ]
    if not summary["enough"]:
        rows = [[what, f"too few ({summary['known']})", "-"] for what, *_ in rows]
    return [f"{summary['objects']} objects, {summary['known']} slides", "figure", "95 % interval"], rows


def _figure(one: dict, key: str, form: str) -> tuple[str, str]:
    def said(value: float | None) -> str:
        return "never" if value is None or np.isinf(value) else form.format(value)

    return said(one[key]), "-" if one["interval"] is None else "...".join(map(said, one["interval"]))
