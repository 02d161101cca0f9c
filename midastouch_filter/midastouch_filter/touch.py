"""What one finger feels in one frame, and where a further finger is while it does."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Measurement:
    """One touch: in_contact; code (D,) or None; contact_area m^2; network_id of the encoder, "" if unknown; relief
    (80, 60) m, the felt penetration reduced by `refinement.reduced_relief`, or None."""

    in_contact: bool
    code: np.ndarray | None = None
    contact_area: float = 0.0
    network_id: str = ""
    relief: np.ndarray | None = None


@dataclass(frozen=True)
class FingerTouch:
    """What a further finger feels: measurement, and T_gel_finger (4, 4), its gel frame in the reference finger's.

    If the two images were taken at different times, the transform is from the one gel then to the other gel then,
    through the frame that the object rests in.
    """

    T_gel_finger: np.ndarray
    measurement: Measurement
