"""Alignment of one pose to what several fingers of one frame feel: a sequential Bayesian update, finger by finger.

The belief about the reference gel, a Gaussian, is carried to the next finger's gel by the adjoint of the transform
between them, aligned to that finger's penetration, and carried back.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from midastouch_perception import se3

from .alignment import Aligned, PenetrationAlignment, without_jitter


class FeltPenetration(NamedTuple):
    """penetration (80, 60) m; T_gel_finger (4, 4), the gel frame that felt it in the reference's; the finger's name.

    None and "" stand for the reference itself."""

    penetration: np.ndarray
    T_gel_finger: np.ndarray | None = None
    name: str = ""


def align_in_turn(
    alignment: PenetrationAlignment,
    pose: np.ndarray,
    covariance: np.ndarray,
    penetrations: Sequence[FeltPenetration],
    finger_error: np.ndarray,
    start: np.ndarray | None = None,
) -> Aligned:
    """Posterior of the reference's prior N(pose (4, 4), covariance (6, 6), own frame) given all maps of a frame.

    finger_error (6, 6): covariance of a further finger's pose, given the reference's. start (4, 4): where the first
    optimum is looked for from. The evidence is the sum of the fingers'; the fit that of the finger which fits worst:
    the pose must explain all of them.
    """
    log_evidence, fit = 0.0, 1.0
    for penetration, T_gel_finger, _ in penetrations:
        if T_gel_finger is None:
            found = alignment.align(pose, covariance, penetration, start)
            pose, covariance = found.pose, found.covariance
        else:
            there, prior = pose @ T_gel_finger, carried(covariance, T_gel_finger)
            start = None if start is None else start @ T_gel_finger
            found = alignment.align(there, prior + finger_error, penetration, start)
            mean, posterior = without_jitter(there, prior, finger_error, found)
            back = se3.inverse(T_gel_finger)
            pose, covariance = mean @ back, carried(posterior, back)
        start = None
        log_evidence += found.log_evidence
        fit = min(fit, found.fit)
    return Aligned(pose, covariance, log_evidence, fit)


def carried(covariance: np.ndarray, motion: np.ndarray) -> np.ndarray:
    """Covariance (6, 6) of a pose's own frame after the frame went on by `motion` (4, 4): adjoint of its inverse."""
    back = se3.inverse(motion)
    r, (x, y, z) = back[:3, :3], back[:3, 3]
    adjoint = se3.turn(r)
    adjoint[:3, 3:] = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) @ r
    return adjoint @ covariance @ adjoint.T
