"""What is known at one frame of a run: the input of every picture."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np

from midastouch_common.pose_metric import particle_rmse


@dataclasses.dataclass(frozen=True)
class Hypothesis:
    """One mode: its share of the particle mass, pose (4, 4) `T_obj_gel` and covariance (6, 6), REP-103
    order."""

    weight: float
    pose: np.ndarray
    covariance: np.ndarray


@dataclasses.dataclass(frozen=True)
class Snapshot:
    """The filter and its input at one frame.

    frame: index in the sequence; time [s] since its start; truth (4, 4) `T_obj_gel`, None where it is not known;
    particles (N, 4, 4), drawn by weight; modes, heaviest first; estimate (4, 4), the published pose, or None before
    the first; image (H, W, 3) uint8; penetration (h, w) m, None if it was not recorded; code (D,) or None without
    contact; state, of the filter; objects, probability of each that may be touched, by name, empty where that was told.
    Pictures of the report need the truth and the penetration, as every demo has them.
    """

    frame: int
    time: float
    truth: np.ndarray | None
    particles: np.ndarray
    modes: list[Hypothesis]
    estimate: np.ndarray | None
    image: np.ndarray
    penetration: np.ndarray | None
    code: np.ndarray | None
    state: str
    objects: Mapping[str, float] = dataclasses.field(default_factory=dict)


def moments(run: list[Snapshot], count: int) -> list[Snapshot]:
    """At most `count` snapshots that tell the run: the first, the last, more of them while the error falls fast.

    Even steps of a clock that runs half by time and half by how far the particles' error has fallen, in log.
    """
    error = np.array([particle_rmse(s.particles, s.truth)[0] for s in run])
    fallen = -np.log(np.minimum.accumulate(np.maximum(error, 1e-6)))
    clock = np.linspace(0, 1, len(run))
    if fallen[-1] > fallen[0]:
        clock = 0.5 * clock + 0.5 * (fallen - fallen[0]) / (fallen[-1] - fallen[0])
    chosen = np.searchsorted(clock, np.linspace(0, clock[-1], count))
    return [run[i] for i in np.unique(np.minimum(chosen, len(run) - 1))]
