"""Summaries of the accuracy over many trials: by variant, start and object, with trust, calibration and recovery."""

from __future__ import annotations

from collections import Counter

import numpy as np

from midastouch_filter.core.state import AMBIGUOUS, CONVERGED

from ..trials.trial import AFTER_EVENT, ERROR_KEYS, STAGES
from ..trials.variants import BASELINE, DEFAULT, PAPER, VARIANTS
from .coverage import KINDS, LEVELS, WEIGHTS, observed_fractions
from .intervals import ENOUGH, Figures


def summarise_trials(trials: list[dict]) -> dict:
    """Return statistics of the final errors per metric, rates and times, over all trials and per object."""
    objects = sorted({t["object"] for t in trials})
    return {
        **_summarise(trials),
        "objects": {name: _summarise([t for t in trials if t["object"] == name]) for name in objects},
    }


def final_errors(trials: list[dict], key: str) -> np.ndarray:
    """Return the final errors (N,) of one metric, nan if a trial has none."""
    return np.array([t["final"][key] for t in trials], float)


def is_right(trial: dict) -> bool:
    """Return whether the trial ended `converged` at a pose that is right by its yardstick."""
    return trial["final"]["state"] == CONVERGED and trial["final"]["right"]


def is_right_or_among_modes(trial: dict) -> bool:
    """Return whether the trial ended as in `is_right`, or `ambiguous` with a mode that is right."""
    ambiguous = trial["final"]["state"] == AMBIGUOUS
    return is_right(trial) or (ambiguous and trial["final"]["among_modes"])


def wrong_converged(trials: list[dict]) -> float:
    """Return the fraction of all frames in which the filter was converged at a wrong pose."""
    return int(converged_wrong_frames(trials).sum()) / max(sum(t["frames"] for t in trials), 1)


def _alarms(trials: list[dict]) -> dict[str, float]:
    """Return `wrong_converged`, and `foreign`: the fraction of trials that report another object at their end."""
    foreign = float(np.mean([t["final"]["foreign"] for t in trials]))
    return {"wrong_converged": wrong_converged(trials), "foreign": foreign}


def _summarise(trials: list[dict]) -> dict:
    out: dict = {"trials": len(trials)}
    for key in ERROR_KEYS:
        # a trial without any mode or pose has no such error; it is counted, not hidden
        values = final_errors(trials, key)
        known = values[np.isfinite(values)]
        out[key] = {"missing": int(len(values) - len(known))}
        if len(known):
            out[key] |= {
                "mean": known.mean(),
                "median": np.median(known),
                "p90": np.percentile(known, 90),
                "max": known.max(),
            }
    out["initial"] = {k: np.array([t["initial"][k] for t in trials], float).mean() for k in ("e_trans_mm", "e_rot_deg")}
    out["states"] = dict(Counter(t["final"]["state"] for t in trials))
    out["converged"] = out["states"].get(CONVERGED, 0)
    out["right"] = sum(map(is_right, trials))
    out["hz_mean"] = np.mean([t["hz_mean"] for t in trials])
    out["hz_p05"] = min(t["hz_p05"] for t in trials)
    out["ms"] = {stage: np.mean([t["ms"][stage] for t in trials]) for stage in STAGES}
    return out


_SUMMARISED = ("coverage", "reliability", "filter_stages_ms", "initial", "protocol")


def summarise_accuracy(trials: list[dict]) -> dict[str, dict[str, dict]]:
    """Return summaries by variant and init, over all trials; of the default and of other methods per object, too."""
    groups: dict[str, dict[str, list[dict]]] = {}
    for trial in trials:
        groups.setdefault(trial["variant"], {}).setdefault(trial["init"], []).append(trial)
    in_full = {name for name in groups if VARIANTS[name].group in (DEFAULT, PAPER, BASELINE)}
    return {
        variant: {init: _summary(some, variant in in_full) for init, some in by_init.items()}
        for variant, by_init in groups.items()
    }


def _summary(trials: list[dict], in_full: bool) -> dict:
    out = summarise_trials(trials) | {
        "coverage": coverage(trials),
        "filter_stages_ms": {
            name: float(np.mean([t["filter_stages_ms"].get(name, 0.0) for t in trials]))
            for name in dict.fromkeys(name for t in trials for name in t["filter_stages_ms"])
        },
        **_alarms(trials),
        "held": grasp_summary(trials),
    }
    if not in_full:
        del out["objects"]
        return out
    out["trust"] = trust(trials)
    for name, one in out["objects"].items():
        one |= _alarms([trial for trial in trials if trial["object"] == name])
    return out


def compact_trials(trials: list[dict]) -> list[dict]:
    """Return the trials for a result file, without the fields that the summaries hold, too."""
    return [
        {key: value for key, value in trial.items() if key not in _SUMMARISED}
        | {"final": {k: v for k, v in trial["final"].items() if not k.startswith("closest_mode")}}
        for trial in trials
    ]


def coverage(trials: list[dict]) -> dict[str, dict]:
    """Return by kind of frame: frames, their number; observed, fraction of them whose truth lies within each of
    `LEVELS`."""
    out = {}
    for kind in KINDS:
        counts = np.sum([trial["coverage"][kind] for trial in trials], axis=0)
        out[kind] = {"frames": int(counts.sum()), "observed": observed_fractions(counts)}
    return out


SHOWN_LEVELS = {level: int(np.argmin(np.abs(LEVELS - level))) for level in (0.5, 0.9, 0.95, 0.99)}
"""Levels that tables show, with their indices in `LEVELS`."""
_ERRORS = ("e", "closest_mode", "estimate")


def trust(trials: list[dict]) -> dict:
    """Return the figures of trust with 95 % intervals: {"share", "interval"}, or {"value", "interval"} by statistic.

    converged_wrong, converged_frames_wrong: converged frames at a wrong pose, of all frames and of the converged ones;
    ambiguous_frames_among: of the ambiguous frames with a truth, those with a right mode; right_at_end;
    right_or_among_modes_at_end: as of that function; right_if_converged_at_end: of the trials that end converged;
    foreign_at_end, foreign_ever: trials that report another object; right_or_said_at_end: foreign_at_end or
    right_or_among_modes_at_end; regions: by kind of frame and level, frames whose region of that level holds the truth;
    region_95: the same of converged frames at 95 %; right_before_event, right_after_event: trials, the latter some
    `frames` later; found_again: those right after, of those right before; misled: of those right before, those that are
    ever converged at a wrong pose; misled_frames: in how many frames; frames_until_right: infinite if never again;
    final errors of particles, closest mode and published pose; ms: of a frame; filter_cpu_ms: of the filter; weights:
    by bin of `WEIGHTS`, frames, and fraction of them whose pose is right.
    enough: whether there are enough trials for a claim.
    """
    figures = Figures.by_slide(trials)
    return {
        "trials": len(trials),
        "enough": len(trials) >= ENOUGH,
        **_at_the_end(trials, figures),
        **_regions(trials, figures),
        **_around_an_event(trials, figures),
        "ms": figures.values([sum(t["ms"][stage] for stage in STAGES) for t in trials]),
        "filter_cpu_ms": figures.values([t["filter_cpu_ms"] for t in trials]),
        "weights": _by_weight(trials, figures),
        **{
            f"{prefix}_{unit}": figures.values(final_errors(trials, f"{prefix}_{unit}"))
            for prefix in _ERRORS
            for unit in ("trans_mm", "rot_deg")
        },
    }


def counted_anew(summary: dict, trials: list[dict]) -> dict:
    """Return a report's summary over these trials, with all that is counted in trials computed by today's code."""
    figures = Figures.by_slide(trials)
    return summary | {"trust": summary["trust"] | _at_the_end(trials, figures) | _around_an_event(trials, figures)}


def frames_until_right(trial: dict) -> float:
    """Return the frames from the event, if any, or the start until it is right to the end; infinite if it never is."""
    if trial["right_from_frame"] is None:
        return np.inf
    return max(trial["right_from_frame"] - (trial["event_at"] or 0), 0)


def right_or_among_modes_at_end(trials: list[dict]) -> dict:
    """Return the fraction of trials, with its interval, that end right, or `ambiguous` with a mode that is right."""
    return Figures.by_slide(trials).fraction([is_right_or_among_modes(trial) for trial in trials])


def pose_right_at_end(trials: list[dict]) -> dict:
    """Return the fraction of trials, with its interval, whose last published pose is right, whatever the state."""
    return Figures.by_slide(trials).fraction([trial["final"]["right"] for trial in trials])


def converged_wrong_frames(trials: list[dict]) -> np.ndarray:
    """Return the number of frames of each trial (T,) that were converged at a wrong pose."""
    return np.subtract([t["frames_converged"] for t in trials], [t["frames_converged_right"] for t in trials])


def converged_figures(trials: list[dict]) -> dict:
    """Return converged_frames_wrong, ambiguous_frames_among and right_if_converged_at_end of `trust`."""
    figures = Figures.by_slide(trials)
    ends_converged = [t["final"]["state"] == CONVERGED for t in trials]
    return {
        "converged_frames_wrong": figures.fraction(
            converged_wrong_frames(trials), [t["frames_converged"] for t in trials]
        ),
        "ambiguous_frames_among": figures.fraction(
            *([t[name] for t in trials] for name in ("frames_ambiguous_among", "frames_ambiguous"))
        ),
        "right_if_converged_at_end": figures.fraction([is_right(t) for t in trials], ends_converged),
    }


def _at_the_end(trials: list[dict], figures: Figures) -> dict:
    """Return the figures of `trust` on states and last answers."""
    foreign = [t["final"]["foreign"] for t in trials]
    return {
        "converged_wrong": figures.fraction(converged_wrong_frames(trials), [t["frames"] for t in trials]),
        **converged_figures(trials),
        "right_at_end": figures.fraction([is_right(t) for t in trials]),
        "right_or_among_modes_at_end": right_or_among_modes_at_end(trials),
        "foreign_at_end": figures.fraction(foreign),
        "foreign_ever": figures.fraction([t["frames_foreign"] > 0 for t in trials]),
        "right_or_said_at_end": figures.fraction(np.logical_or(foreign, [is_right_or_among_modes(t) for t in trials])),
    }


def _regions(trials: list[dict], figures: Figures) -> dict:
    """Return the figures of `trust` on regions."""

    def of(kind: str) -> dict:
        counts = np.array([t["coverage"][kind] for t in trials])
        within = np.cumsum(counts, axis=1)
        return {f"{level:g}": figures.fraction(within[:, k], counts.sum(axis=1)) for level, k in SHOWN_LEVELS.items()}

    regions = {kind: of(kind) for kind in (CONVERGED, "right")}
    return {"region_95": regions[CONVERGED]["0.95"], "regions": regions}


def _around_an_event(trials: list[dict], figures: Figures) -> dict:
    wrong = converged_wrong_frames(trials)
    asked = [t["right_after_event"] is not None for t in trials]
    before = [bool(t["right_before_event"]) for t in trials]
    after = [bool(t["right_after_event"]) for t in trials]
    return {
        "right_before_event": figures.fraction(before, [t["right_before_event"] is not None for t in trials]),
        "right_after_event": figures.fraction(after, asked) | {"frames": AFTER_EVENT},
        "found_again": figures.fraction(np.logical_and(before, after), np.logical_and(before, asked)),
        "misled": figures.fraction(np.logical_and(before, wrong > 0), before),
        "misled_frames": figures.values(np.where(before, wrong, np.nan)),
        "frames_until_right": {"median": figures.value([frames_until_right(t) for t in trials], np.median)},
    }


def _by_weight(trials: list[dict], figures: Figures) -> list[dict]:
    out = []
    for k in range(len(WEIGHTS) + 1):
        frames, right = ([t["reliability"][name][k] for t in trials] for name in ("frames", "right"))
        out.append({"frames": int(np.sum(frames)), "right": figures.fraction(right, frames)})
    return out


def grasp_summary(trials: list[dict]) -> list[dict] | None:
    """Return a summary for each time at which held grasps are asked; None without grasps. It has the number of trials
    and, with 95 % intervals, the fractions of trials that `found` a right mode, whose pose is `right`, and that are
    `converged` or `converged_wrong`, and the mean `share`, the probability at the true pose."""
    if not all("held" in trial for trial in trials):
        return None
    figures = Figures.by_slide(trials)
    out = []
    for rows in zip(*(trial["held"] for trial in trials), strict=True):
        parts = {name: [row[name] for row in rows] for name in ("found", "share", "right", "converged")}
        parts["converged_wrong"] = [row["converged"] and not row["right"] for row in rows]
        out.append({"trials": len(rows)} | {name: figures.fraction(part) for name, part in parts.items()})
    return out
