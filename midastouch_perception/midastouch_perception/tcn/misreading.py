"""How sensors misread depth: what the depth network's own errors in simulation do not show.

On real gel the felt depth is off by a factor that belongs to the sensor, and gel that sinks in around a contact makes
its outline soft. Codes must tell places apart all the same.
"""

from __future__ import annotations

import cv2
import numpy as np

_SHARE = 0.5  # of the touches: the others are as the depth network saw them
_SCALE = 0.7, 1.4
_SOFTENING = 3.0  # pixels
_THRESHOLD = 0.1e-3  # m


def misread(maps: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Penetration maps (N, H, W) float32 m, half of them as a sensor would feel them that is off: depth scaled by
    0.7 to 1.4, and for half of these the relief blurred by up to 3 pixels and cut off below up to 0.1 mm."""
    out = maps.copy()
    for i in np.flatnonzero(rng.random(len(maps)) < _SHARE):
        out[i] *= np.exp(rng.uniform(*np.log(_SCALE)))
        if rng.random() < 0.5:
            soft = cv2.GaussianBlur(out[i], (0, 0), rng.uniform(0.3, _SOFTENING))
            out[i] = np.where(soft > rng.uniform(0.1, 1) * min(_THRESHOLD, 0.5 * soft.max()), soft, 0)
    return out
