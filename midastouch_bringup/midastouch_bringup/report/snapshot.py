"""What is known at one frame of a run: the input of every picture."""

from __future__ import annotations

import dataclasses

import numpy as np


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

    frame: index in the sequence; time [s] since its start; truth (4, 4) `T_obj_gel`; particles (N, 4, 4),
    drawn by weight; modes, heaviest first; estimate (4, 4), the published pose, or None before the first;
    image (H, W, 3) uint8; penetration (h, w) m; code (D,) or None without contact; state, of the filter.
    """

    frame: int
    time: float
    truth: np.ndarray
    particles: np.ndarray
    modes: list[Hypothesis]
    estimate: np.ndarray | None
    image: np.ndarray
    penetration: np.ndarray
    code: np.ndarray | None
    state: str
