"""What may be relied on: how often answers are right, by state, around an event and by weight, with intervals."""

from __future__ import annotations

import numpy as np

from midastouch_filter.core.state import AMBIGUOUS, CONVERGED

from ..trials.trial import AFTER_EVENT, STAGES
from .coverage import LEVELS, WEIGHTS
from .figures import Figures
from .intervals import ENOUGH
from .summary import final_errors, is_right

SHOWN_LEVELS = {level: int(np.argmin(np.abs(LEVELS - level))) for level in (0.5, 0.9, 0.95, 0.99)}
"""What tables show of `LEVELS`, and where it is there."""
_ERRORS = ("e", "closest_mode", "estimate")


def trust(trials: list[dict]) -> dict:
    """What may be relied on, each figure with its 95 % interval: {"share" or "mean" or "median", "interval"}.

    converged_wrong, of all frames, and converged_frames_wrong, of the converged ones; right_at_end;
    right_modulo_symmetry_at_end; right_or_among_modes_at_end, as of that function; right_if_converged_at_end, of
    trials that end converged, and with ..._modulo_symmetry; regions, by kind of frame and level, share of frames
    whose region of that level holds the truth, and region_95, that of converged frames at 95 %; right_before_event,
    right_after_event, of trials, the latter so many frames later; found_again, of those that were right before;
    misled, of these too, which are ever converged at a wrong place, and misled_frames, in how many frames;
    frames_until_right, infinite where it never is again; final errors of particles, closest mode and published pose;
    ms of a frame, of which filter_cpu_ms; weights, by bin of `WEIGHTS`: frames, mean weight of the published mode,
    right, share of them whose pose is.
    enough: whether there are trials enough to claim anything.
    """
    figures = Figures.by_slide(trials)
    return {
        "trials": len(trials),
        "enough": len(trials) >= ENOUGH,
        **_at_the_end(trials, figures),
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


def frames_until_right(trial: dict) -> float:
    """From the event to where it is right until the end; without an event from the start."""
    if trial["right_from_frame"] is None:
        return np.inf
    return max(trial["right_from_frame"] - (trial["event_at"] or 0), 0)


def right_or_among_modes_at_end(trials: list[dict]) -> dict:
    """Share of trials, with its 95 % interval, that end right, or `ambiguous` with a mode that would be right."""
    near = [float(t["final"]["min_cluster_trans_mm"] or np.inf) <= 1e3 * t["right_m"] for t in trials]
    among = [t["final"]["state"] == AMBIGUOUS and each for t, each in zip(trials, near, strict=True)]
    return Figures.by_slide(trials).share(np.logical_or([is_right(t) for t in trials], among))


def _converged_wrong(trials: list[dict]) -> np.ndarray:
    """Frames (T,) that were converged at a wrong place."""
    return np.subtract([t["frames_converged"] for t in trials], [t["frames_converged_right"] for t in trials])


def _at_the_end(trials: list[dict], figures: Figures) -> dict:
    """What states and regions promise, and what the last answers are."""
    wrong = _converged_wrong(trials)
    ends_converged = [t["final"]["state"] == CONVERGED for t in trials]
    right = {key: [is_right(t, f"{key}estimate_trans_mm") for t in trials] for key in ("", "symmetric_")}

    def regions(kind: str) -> dict:
        counts = np.array([t["coverage"][kind] for t in trials])
        within = np.cumsum(counts, axis=1)
        return {f"{level:g}": figures.share(within[:, k], counts.sum(axis=1)) for level, k in SHOWN_LEVELS.items()}

    return {
        "converged_wrong": figures.share(wrong, [t["frames"] for t in trials]),
        "converged_frames_wrong": figures.share(wrong, [t["frames_converged"] for t in trials]),
        "right_at_end": figures.share(right[""]),
        "right_modulo_symmetry_at_end": figures.share(right["symmetric_"]),
        "right_or_among_modes_at_end": right_or_among_modes_at_end(trials),
        "right_if_converged_at_end": figures.share(right[""], ends_converged),
        "right_if_converged_modulo_symmetry_at_end": figures.share(right["symmetric_"], ends_converged),
        "region_95": regions(CONVERGED)["0.95"],
        "regions": {kind: regions(kind) for kind in (CONVERGED, "right")},
    }


def _around_an_event(trials: list[dict], figures: Figures) -> dict:
    wrong = _converged_wrong(trials)
    asked = [t["right_after_event"] is not None for t in trials]
    before = [bool(t["right_before_event"]) for t in trials]
    after = [bool(t["right_after_event"]) for t in trials]
    return {
        "right_before_event": figures.share(before, [t["right_before_event"] is not None for t in trials]),
        "right_after_event": figures.share(after, asked) | {"frames": AFTER_EVENT},
        "found_again": figures.share(np.logical_and(before, after), np.logical_and(before, asked)),
        "misled": figures.share(np.logical_and(before, wrong > 0), before),
        "misled_frames": figures.values(np.where(before, wrong, np.nan)),
        "frames_until_right": {"median": figures.value([frames_until_right(t) for t in trials], np.median)},
    }


def _by_weight(trials: list[dict], figures: Figures) -> list[dict]:
    out = []
    for k in range(len(WEIGHTS) + 1):
        frames, right, weight = ([t["reliability"][name][k] for t in trials] for name in ("frames", "right", "weight"))
        count = int(np.sum(frames))
        mean = float(np.sum(weight)) / count if count else None
        out.append({"frames": count, "mean_weight": mean, "right": figures.share(right, frames)})
    return out
