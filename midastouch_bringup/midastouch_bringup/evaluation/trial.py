"""One run of the whole pipeline over a sequence: every frame, in order, no middleware (DESIGN 4.2)."""

from __future__ import annotations

import dataclasses
import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence

import numpy as np

from midastouch_filter.filter import Estimate, Measurement, ParticleFilter
from midastouch_filter.refinement import reduced_relief
from midastouch_perception import se3
from midastouch_perception.pipeline import Touch, TouchPipeline

from .metrics import closest_mode_error, min_cluster_error, particle_rmse, pose_errors

STAGES = ("tdn", "tcn", "filter")


@dataclasses.dataclass(frozen=True)
class TrialFrame:
    """Input of one step: index in the sequence, image (H, W, 3) uint8, measured and true `T_obj_gel` (4, 4).

    Only differences of the measured pose reach the filter.
    """

    index: int
    image: np.ndarray
    measured: np.ndarray
    truth: np.ndarray


Observer = Callable[[TrialFrame, Touch, Estimate, ParticleFilter], None]


def measure(touch: Touch) -> Measurement:
    """What the filter is told of a touch."""
    relief = reduced_relief(touch.penetration) if touch.in_contact else None
    return Measurement(touch.in_contact, touch.code, touch.area_m2, touch.network_id, relief)


def run_trial(
    frames: Iterable[TrialFrame],
    pipeline: TouchPipeline,
    background: np.ndarray,
    particle_filter: ParticleFilter,
    observe: Observer | None = None,
) -> dict:
    """Run an initialised filter over the frames; the `trials` entry of the `evaluate` JSON without its
    labels.

    Time is counted from the image to the estimate (TDN, TCN and filter); reading files and computing errors
    are not. Errors are taken after every step: Eq. 3 over the weighted particles, Eq. 4 over the modes, the
    published pose. `observe` sees every frame with its touch, estimate and the filter, outside the timing.
    """
    record = _Record()
    previous = None
    for frame in frames:
        if previous is None:
            record.start(frame.truth, particle_filter)
        odometry = None if previous is None else se3.inverse(previous) @ frame.measured
        previous = frame.measured
        start = time.perf_counter()
        touch = pipeline.process(frame.image, background)
        perceived = time.perf_counter()
        estimate = particle_filter.step(odometry, measure(touch))
        end = time.perf_counter()
        record.add(frame, touch, estimate, particle_filter, end - start, end - perceived)
        if observe is not None:
            observe(frame, touch, estimate, particle_filter)
    return record.result()


class _Record:
    def __init__(self) -> None:
        self._columns: dict[str, list] = {}
        self._seconds: list[float] = []
        self._initial: dict[str, float] = {}
        self._filter_ms: Counter[str] = Counter()

    def start(self, truth: np.ndarray, particle_filter: ParticleFilter) -> None:
        """Errors before the first step, of the start itself."""
        self._initial = _error("e", particle_rmse(particle_filter.poses, truth, particle_filter.weights))

    def add(self, frame, touch, estimate, particle_filter, seconds, filter_seconds) -> None:
        self._seconds.append(seconds)
        self._filter_ms.update(estimate.status.ms)
        status, truth = estimate.status, frame.truth
        poses, weights = particle_filter.poses, particle_filter.weights
        modes = np.array([mode.pose for mode in estimate.modes]).reshape(-1, 4, 4)
        row = {"frame": frame.index}
        row |= _error("e", particle_rmse(poses, truth, weights))
        row |= _error("e_unweighted", particle_rmse(poses, truth))
        row |= _error("min_cluster", min_cluster_error(modes, truth))
        row |= _error("closest_mode", closest_mode_error(modes, truth))
        row |= _error("estimate", (np.nan, np.nan) if estimate.pose is None else pose_errors(estimate.pose, truth))
        row |= {
            "n_particles": status.n_particles,
            "n_modes": status.n_modes,
            "mode_mass": status.mode_mass,
            "ess": status.ess,
            "state": status.state,
            "in_contact": touch.in_contact,
            "ms_tdn": touch.ms.get("tdn", 0.0),
            "ms_tcn": touch.ms.get("tcn", 0.0),
            "ms_filter": 1e3 * filter_seconds,
            "ms": 1e3 * seconds,
            "estimate": None if estimate.pose is None else np.round(se3.to_xyzquat(estimate.pose), 6),
        }
        for key, value in row.items():
            self._columns.setdefault(key, []).append(value)

    def result(self) -> dict:
        columns, seconds = self._columns, np.array(self._seconds)
        state = columns["state"]
        return {
            "frames": len(seconds),
            "wall_s": float(seconds.sum()),
            "hz_mean": float(len(seconds) / seconds.sum()),
            # the 5th percentile of the rate is the 95th of the time per frame
            "hz_p05": float(1 / np.percentile(seconds, 95)),
            "ms": {stage: float(np.mean(columns[f"ms_{stage}"])) for stage in STAGES},
            "filter_stages_ms": {name: ms / len(seconds) for name, ms in self._filter_ms.items()},
            "initial": self._initial,
            "final": {key: columns[key][-1] for key in FINAL_KEYS},
            "converged_at_frame": columns["frame"][state.index("converged")] if "converged" in state else None,
            "per_frame": columns,
        }


ERROR_KEYS = tuple(
    f"{prefix}_{unit}"
    for prefix in ("e", "min_cluster", "closest_mode", "estimate")
    for unit in ("trans_mm", "rot_deg")
)
FINAL_KEYS = (*ERROR_KEYS, "n_particles", "state")


def _error(prefix: str, error: Sequence[float]) -> dict[str, float]:
    return {f"{prefix}_trans_mm": 1e3 * float(error[0]), f"{prefix}_rot_deg": float(np.degrees(error[1]))}
