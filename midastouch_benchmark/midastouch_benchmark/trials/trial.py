"""One run of a filter over a sequence: every frame, in order, no middleware."""

from __future__ import annotations

import dataclasses
import itertools
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

import numpy as np
import pandas as pd

from midastouch_common import se3
from midastouch_common.pose_metric import closest_mode_error, min_cluster_error, particle_rmse, pose_errors
from midastouch_filter.core.estimate import Estimate
from midastouch_filter.core.state import AMBIGUOUS, CONVERGED
from midastouch_filter.core.touch import Measurement
from midastouch_filter.filter import ParticleFilter
from midastouch_filter.paper_filter import PaperFilter

from ..baselines.registration import DeadReckoning
from ..statistics.coverage import level_counts, nees, weight_counts
from .yardstick import Yardstick

STAGES = ("tdn", "tcn", "filter")
RECORD = 8
"""Version of the result of `run_trial`; kept trials of another version are run again."""

AFTER_EVENT = 30
"""Frames from an event to the next check whether the filter is right."""

AnyFilter = ParticleFilter | PaperFilter | DeadReckoning


@dataclasses.dataclass(frozen=True)
class TrialFrame:
    """Input of one step. index: in the sequence; measurement; ms: time [ms] of the networks for it; measured, truth:
    `T_obj_gel` (4, 4), the truth nan if there is none, as on the wrong object; seconds: since the frame before, None if
    unknown; others: measurements of further fingers, by name.

    Only differences of the measured pose reach the filter.
    """

    index: int
    measurement: Measurement
    ms: dict[str, float]
    measured: np.ndarray
    truth: np.ndarray
    seconds: float | None = None
    others: Mapping[str, Measurement] = dataclasses.field(default_factory=dict)


def with_odometry(frames: Iterable[TrialFrame]) -> Iterator[tuple[TrialFrame, np.ndarray | None]]:
    """Yield each frame with the odometry (4, 4) since the one before it, None at first."""
    frames, again = itertools.tee(frames)
    return zip(frames, se3.odometry(frame.measured for frame in again), strict=True)


FRAME_TIME = 0.05
"""Time [s] between frames of a simulated slide: 1.5 mm apart at 30 mm/s."""


@dataclasses.dataclass(frozen=True)
class Event:
    """Event on a slide, by positions of frames: start: the first one affected; end: the first ordinary one after it."""

    start: int
    end: int


Observer = Callable[[TrialFrame, Estimate, AnyFilter], object]


def run_trial(
    frames: Iterable[TrialFrame],
    particle_filter: AnyFilter,
    observe: Observer | None = None,
    yardstick: Yardstick | None = None,
    series: bool = True,
    event: Event | None = None,
) -> dict:
    """Run an initialised filter over the frames; return the `trials` entry of the `evaluate` JSON without its labels.

    Time counts from the image to the estimate (networks and filter); reading files and computing errors do not count.
    On a busy machine only the filter's CPU time, of all its threads, is reliable.
    Errors are taken after every step: Eq. 3 over the weighted particles, Eq. 4 over the modes, the published pose.
    Without `series` only the last frame's are kept and `per_frame` is left out: errors over all particles take longer
    than the filter. All errors are modulo the yardstick's symmetry, and the yardstick decides which poses are right.
    `observe` is called with every frame, its estimate and the filter, outside the timing. `event`: on the way, after
    which the pose is judged again.
    """
    yardstick, initial = yardstick or Yardstick(), {}
    judged, rows = [], []
    stages: Counter[str] = Counter()
    for frame, odometry in with_odometry(frames):
        if odometry is None:  # the errors of the start itself
            poses = yardstick.counted(particle_filter.poses, frame.truth)
            initial = _error("e", particle_rmse(poses, frame.truth, particle_filter.weights))
        fingers = {"others": frame.others} if frame.others else {}  # other methods know one finger only
        start, cpu_start = time.perf_counter(), time.process_time()
        estimate = particle_filter.step(odometry, frame.measurement, elapsed=frame.seconds, **fingers)
        ms, cpu_ms = 1e3 * (time.perf_counter() - start), 1e3 * (time.process_time() - cpu_start)
        judged.append(_judged(frame, estimate, yardstick) | {"ms": frame.ms | {"filter": ms}, "cpu_ms": cpu_ms})
        stages.update(estimate.status.ms)
        if series:
            rows.append(_row(frame, estimate, particle_filter, yardstick, judged[-1]))
        if observe is not None:
            observe(frame, estimate, particle_filter)
    last = rows[-1] if series else _row(frame, estimate, particle_filter, yardstick, judged[-1])
    out = _summary(pd.DataFrame(judged), event) | yardstick.describe()
    out |= {"initial": initial, "final": {key: last[key] for key in FINAL_KEYS}}
    out |= {"filter_stages_ms": {name: each / len(judged) for name, each in stages.items()}}
    return out | ({"per_frame": {key: [row[key] for row in rows] for key in last}} if series else {})


def _judged(frame: TrialFrame, estimate: Estimate, yardstick: Yardstick) -> dict:
    """Return all that a trial counts of one frame, without its times."""
    touch, status = frame.measurement, estimate.status
    known, right, error = bool(np.isfinite(frame.truth).all()), False, None
    if estimate.pose is not None and known:
        right = bool(yardstick.right(estimate.pose[None], frame.truth)[0])
        if touch.in_contact:
            # the symmetric pose of the truth, not of the estimate: the covariance belongs to the pose as published
            error = nees(estimate, yardstick.counted(frame.truth[None], estimate.pose)[0])
    return {
        "index": frame.index, "state": status.state, "foreign": status.foreign, "known": known, "right": right,
        "among_modes": bool(yardstick.right(_mode_poses(estimate), frame.truth).any()),
        "in_contact": touch.in_contact, "area": touch.contact_area if touch.in_contact else np.nan,
        "judged": error is not None, "nees": error, "n_modes": status.n_modes, "mode_mass": status.mode_mass,
    }  # fmt: skip


def _row(frame: TrialFrame, estimate: Estimate, particle_filter: AnyFilter, yardstick: Yardstick, judged: dict) -> dict:
    """Return all that `per_frame` has of one frame; judged: what the trial counts of it, with its times."""
    status, truth, counted = estimate.status, frame.truth, yardstick.counted
    poses, weights = counted(particle_filter.poses, truth), particle_filter.weights
    modes = counted(_mode_poses(estimate), truth)
    pose = np.full((4, 4), np.nan) if estimate.pose is None else counted(estimate.pose[None], truth)[0]
    ms = [judged["ms"].get(stage, 0.0) for stage in STAGES]
    return {
        "frame": frame.index,
        **_error("e", particle_rmse(poses, truth, weights)),
        **_error("e_unweighted", particle_rmse(poses, truth)),
        **_error("min_cluster", min_cluster_error(modes, truth)),
        **_error("closest_mode", closest_mode_error(modes, truth)),
        **_error("estimate", pose_errors(pose, truth)),
        **{name: getattr(status, name) for name in ("n_particles", "n_modes", "mode_mass", "ess")},
        **{name: judged[name] for name in ("state", "foreign", "right", "among_modes", "in_contact")},
        **{f"ms_{stage}": each for stage, each in zip(STAGES, ms, strict=True)},
        "ms": sum(ms),
        "estimate": None if estimate.pose is None else np.round(se3.to_xyzquat(estimate.pose), 6),
    }


def _summary(frames: pd.DataFrame, event: Event | None) -> dict:
    """Return the times of a trial, and how often it was right; frames: as of `_judged`, with their times."""
    judged = frames[frames["judged"]]
    ms = {stage: [each.get(stage, 0.0) for each in frames["ms"]] for stage in STAGES}
    seconds = 1e-3 * np.sum(list(ms.values()), axis=0)
    in_contact, converged = (np.array(each) for each in (frames["in_contact"], frames["state"] == CONVERGED))
    ambiguous = (frames["state"] == AMBIGUOUS) & frames["known"]
    kept = converged & np.array(frames["right"])
    return {
        "frames": len(seconds),
        "wall_s": float(seconds.sum()),
        "hz_mean": float(len(seconds) / seconds.sum()),
        # the 5th percentile of the rate is the 95th of the time per frame
        "hz_p05": float(1 / np.percentile(seconds, 95)),
        "ms": {stage: float(np.mean(each)) for stage, each in ms.items()},
        "filter_cpu_ms": float(np.mean(frames["cpu_ms"])),
        "converged_at_frame": int(frames["index"][converged].iloc[0]) if converged.any() else None,
        "right_from_frame": _from_then_on(kept | ~in_contact),
        **_around_event(kept, event),
        "frames_in_contact": int(in_contact.sum()),
        "contact_area_mm2": 1e6 * float(np.mean(frames["area"][in_contact])) if in_contact.any() else None,
        "frames_converged": int(converged.sum()),
        "frames_converged_right": int(kept.sum()),
        "frames_foreign": int(frames["foreign"].sum()),
        "frames_ambiguous": int(ambiguous.sum()),
        "frames_ambiguous_among": int((ambiguous & frames["among_modes"]).sum()),
        "coverage": level_counts(judged),
        "reliability": weight_counts(judged),
    }


def _around_event(right: np.ndarray, event: Event | None) -> dict:
    """Return when an event ends, and whether the frame before it and one some frames later are right; right: (N,).

    All are None without an event, the last also if the slide is shorter.
    """
    if event is None:
        return dict.fromkeys(("event_at", "right_before_event", "right_after_event"))
    after = event.end + AFTER_EVENT
    later = bool(right[after]) if after < len(right) else None
    return {"event_at": event.end, "right_before_event": bool(right[event.start - 1]), "right_after_event": later}


def _from_then_on(holds: np.ndarray) -> int | None:
    """Return the index of the frame from which something holds (N,) to the end; None if it does not at the end."""
    fails = np.flatnonzero(~holds)
    first = int(fails[-1]) + 1 if len(fails) else 0
    return first if first < len(holds) else None


ERROR_KEYS = tuple(
    f"{prefix}_{unit}"
    for prefix in ("e", "min_cluster", "closest_mode", "estimate")
    for unit in ("trans_mm", "rot_deg")
)
FINAL_KEYS = (*ERROR_KEYS, "n_particles", "state", "foreign", "right", "among_modes")


def _mode_poses(estimate: Estimate) -> np.ndarray:
    """Return the poses of the modes (K, 4, 4)."""
    return np.array([mode.pose for mode in estimate.modes]).reshape(-1, 4, 4)


def _error(prefix: str, error: Sequence[float | np.ndarray]) -> dict[str, float]:
    return {f"{prefix}_trans_mm": 1e3 * float(error[0]), f"{prefix}_rot_deg": float(np.degrees(error[1]))}
