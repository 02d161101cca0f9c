"""Alignment of one pose to what several fingers of one frame feel: a sequential Bayesian update, finger by finger.

The belief about the first gel, a Gaussian, is transformed to the next finger's gel by the adjoint of the transform
between them, aligned to that finger's penetration map, and transformed back.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from midastouch_common import se3

from .alignment import Aligned, PenetrationAlignment, without_jitter
from .touch import Measurement


def align_in_turn(
    alignment: PenetrationAlignment,
    pose: np.ndarray,
    covariance: np.ndarray,
    touches: Sequence[Measurement],
    finger_error: np.ndarray,
    start: np.ndarray | None = None,
) -> Aligned:
    """Posterior of the first finger's prior N(pose (4, 4), covariance (6, 6), own frame) given all maps of a frame.

    finger_error (6, 6): covariance of a further finger's pose, given the first one's. start (4, 4): where the first
    optimum is looked for from. The evidence is the sum of the fingers'; the fit that of the finger which fits worst:
    the pose must explain all of them.
    """
    log_evidence, fit = 0.0, 1.0
    for touch in touches:
        penetration, T_gel_finger = touch.penetration, touch.T_gel_finger
        if T_gel_finger is None:
            found = alignment.align(pose, covariance, penetration, start)
            pose, covariance = found.pose, found.covariance
        else:
            there, prior = pose @ T_gel_finger, transform_covariance(covariance, T_gel_finger)
            start = None if start is None else start @ T_gel_finger
            found = alignment.align(there, prior + finger_error, penetration, start)
            mean, posterior = without_jitter(there, prior, finger_error, found)
            back = se3.inverse(T_gel_finger)
            pose, covariance = mean @ back, transform_covariance(posterior, back)
        start = None
        log_evidence += found.log_evidence
        fit = min(fit, found.fit)
    return Aligned(pose, covariance, log_evidence, fit)


def transform_covariance(covariance: np.ndarray, motion: np.ndarray) -> np.ndarray:
    """Covariance (6, 6) of a pose's own frame after the frame went on by `motion` (4, 4)."""
    on = adjoint(motion)
    return on @ covariance @ on.T


def adjoint(motion: np.ndarray) -> np.ndarray:
    """(6, 6) that takes a tangent vector of a pose's own frame to the frame that went on by `motion` (4, 4)."""
    back = se3.inverse(motion)
    r, (x, y, z) = back[:3, :3], back[:3, 3]
    out = se3.turn(r)
    out[:3, 3:] = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) @ r
    return out
