"""One run of a filter over a sequence: every frame, in order, no middleware."""

from __future__ import annotations

import dataclasses
import itertools
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

import numpy as np

from midastouch_common import se3
from midastouch_common.pose_metric import closest_mode_error, min_cluster_error, particle_rmse, pose_errors
from midastouch_filter.core.estimate import Estimate
from midastouch_filter.core.state import AMBIGUOUS, CONVERGED
from midastouch_filter.core.touch import Measurement
from midastouch_filter.filter import ParticleFilter
from midastouch_filter.paper_filter import PaperFilter

from ..baselines.registration import DeadReckoning
from ..statistics.coverage import Coverage, WeightReliability
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
    record = _Record(yardstick or Yardstick(), series, event)
    for frame, odometry in with_odometry(frames):
        if odometry is None:
            record.start(frame.truth, particle_filter)
        fingers = {"others": frame.others} if frame.others else {}  # other methods know one finger only
        start, cpu_start = time.perf_counter(), time.process_time()
        estimate = particle_filter.step(odometry, frame.measurement, elapsed=frame.seconds, **fingers)
        ms, cpu_ms = 1e3 * (time.perf_counter() - start), 1e3 * (time.process_time() - cpu_start)
        record.add(frame, estimate, particle_filter, ms, cpu_ms)
        if observe is not None:
            observe(frame, estimate, particle_filter)
    return record.result(particle_filter)


class _Record:
    def __init__(self, yardstick: Yardstick, series: bool, event: Event | None) -> None:
        self._yardstick, self._series, self._event = yardstick, series, event
        self._rows: list[dict] = []
        self._ms: dict[str, list[float]] = {stage: [] for stage in STAGES}
        self._initial: dict[str, float] = {}
        self._filter_ms: Counter[str] = Counter()
        self._filter_cpu_ms: list[float] = []
        self._states: list[tuple[int, str]] = []
        self._in_contact: list[bool] = []
        self._areas: list[float] = []
        self._right: list[bool] = []
        self._among: list[bool] = []
        self._known: list[bool] = []
        self._foreign: list[bool] = []
        self._coverage, self._reliability = Coverage(), WeightReliability()

    def start(self, truth: np.ndarray, particle_filter: AnyFilter) -> None:
        """Record the errors of the start itself, before the first step; truth: (4, 4) `T_obj_gel`."""
        poses = self._yardstick.counted(particle_filter.poses, truth)
        self._initial = _error("e", particle_rmse(poses, truth, particle_filter.weights))

    def add(
        self, frame: TrialFrame, estimate: Estimate, particle_filter: AnyFilter, filter_ms: float, filter_cpu_ms: float
    ) -> None:
        for stage in STAGES:
            self._ms[stage].append(frame.ms.get(stage, 0.0) if stage != "filter" else filter_ms)
        self._filter_ms.update(estimate.status.ms)
        self._filter_cpu_ms.append(filter_cpu_ms)
        self._states.append((frame.index, estimate.status.state))
        self._foreign.append(estimate.status.foreign)
        self._in_contact.append(frame.measurement.in_contact)
        if frame.measurement.in_contact:
            self._areas.append(frame.measurement.contact_area)
        modes = _mode_poses(estimate)
        self._known.append(bool(np.isfinite(frame.truth).all()))
        self._among.append(bool(self._yardstick.right(modes, frame.truth).any()))
        self._right.append(False)
        if estimate.pose is not None and self._known[-1]:
            self._right[-1] = bool(self._yardstick.right(estimate.pose[None], frame.truth)[0])
            if frame.measurement.in_contact:
                # the symmetric pose of the truth, not of the estimate: the covariance belongs to the pose as published
                truth = self._yardstick.counted(frame.truth[None], estimate.pose)[0]
                self._coverage.add(estimate, truth, self._right[-1])
                self._reliability.add(estimate.status.mode_mass, self._right[-1])
        self._last = frame, estimate
        if self._series:
            self._rows.append(self._row(frame, estimate, particle_filter))

    def _row(self, frame: TrialFrame, estimate: Estimate, particle_filter: AnyFilter) -> dict:
        """Return all that `per_frame` has of one frame."""
        status, truth, counted = estimate.status, frame.truth, self._yardstick.counted
        poses, weights = counted(particle_filter.poses, truth), particle_filter.weights
        modes = counted(_mode_poses(estimate), truth)
        pose = np.full((4, 4), np.nan) if estimate.pose is None else counted(estimate.pose[None], truth)[0]
        row: dict[str, float] = {"frame": frame.index}
        row |= _error("e", particle_rmse(poses, truth, weights))
        row |= _error("e_unweighted", particle_rmse(poses, truth))
        row |= _error("min_cluster", min_cluster_error(modes, truth))
        row |= _error("closest_mode", closest_mode_error(modes, truth))
        row |= _error("estimate", pose_errors(pose, truth))
        return row | {
            "n_particles": status.n_particles,
            "n_modes": status.n_modes,
            "mode_mass": status.mode_mass,
            "ess": status.ess,
            "state": status.state,
            "foreign": status.foreign,
            "right": self._right[-1],
            "among_modes": self._among[-1],
            "in_contact": frame.measurement.in_contact,
            **{f"ms_{stage}": self._ms[stage][-1] for stage in STAGES},
            "ms": sum(self._ms[stage][-1] for stage in STAGES),
            "estimate": None if estimate.pose is None else np.round(se3.to_xyzquat(estimate.pose), 6),
        }

    def result(self, particle_filter: AnyFilter) -> dict:
        frame, estimate = self._last
        last = self._rows[-1] if self._series else self._row(frame, estimate, particle_filter)
        seconds = 1e-3 * np.sum([self._ms[stage] for stage in STAGES], axis=0)
        converged = np.array([state == CONVERGED for _, state in self._states])
        right, in_contact = np.array(self._right), np.array(self._in_contact)
        ambiguous = np.array([state == AMBIGUOUS for _, state in self._states]) & self._known
        out = {
            "frames": len(seconds),
            "wall_s": float(seconds.sum()),
            "hz_mean": float(len(seconds) / seconds.sum()),
            # the 5th percentile of the rate is the 95th of the time per frame
            "hz_p05": float(1 / np.percentile(seconds, 95)),
            "ms": {stage: float(np.mean(self._ms[stage])) for stage in STAGES},
            "filter_cpu_ms": float(np.mean(self._filter_cpu_ms)),
            "filter_stages_ms": {name: ms / len(seconds) for name, ms in self._filter_ms.items()},
            "initial": self._initial,
            "final": {key: last[key] for key in FINAL_KEYS},
            "converged_at_frame": next((index for index, state in self._states if state == CONVERGED), None),
            "right_from_frame": _from_then_on((converged & right) | ~in_contact),
            "event_at": self._event.end if self._event else None,
            "right_before_event": bool((converged & right)[self._event.start - 1]) if self._event else None,
            "right_after_event": self._right_after_event(converged & right),
            "frames_in_contact": int(in_contact.sum()),
            "contact_area_mm2": 1e6 * float(np.mean(self._areas)) if self._areas else None,
            "frames_converged": int(converged.sum()),
            "frames_converged_right": int((converged & right).sum()),
            "frames_foreign": sum(self._foreign),
            "frames_ambiguous": int(ambiguous.sum()),
            "frames_ambiguous_among": int((ambiguous & self._among).sum()),
            **self._yardstick.describe(),
            "coverage": self._coverage.counts(),
            "reliability": self._reliability.counts(),
        }
        if self._series:
            out["per_frame"] = {key: [row[key] for row in self._rows] for key in last}
        return out

    def _right_after_event(self, right: np.ndarray) -> bool | None:
        """Return whether it is right (N,) some frames after the event; None without one, or if the slide is shorter."""
        if self._event is None or self._event.end + AFTER_EVENT >= len(right):
            return None
        return bool(right[self._event.end + AFTER_EVENT])


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
