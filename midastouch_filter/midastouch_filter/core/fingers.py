"""Check of the measurements of all fingers on one object.

The state is the pose of the first finger's gel; the transform between the gels gives the pose of every other finger.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from midastouch_common.errors import InputError

from .gates import Gates
from .motion_model import Odometry
from .object_model import ObjectModel
from .touch import Measurement

FIRST = ""
"""Name of the first finger; hypotheses are poses of its gel."""

_LARGEST_HAND = 10.0  # m between two fingers of one hand
_ONE_SPOT = 1e-3  # m between two gels that face the same way; real ones are as wide as their gel apart


class Fingers:
    """Check of measurements.

    Args: model of an object, which has the format of codes and maps; gates, which count what is refused.
    """

    def __init__(self, model: ObjectModel, gates: Gates):
        self._model, self._gates = model, gates

    def usable(self, touches: Mapping[str, Measurement]) -> list[Measurement]:
        """Return the touches with codes of length 1 and, if maps are compared, with maps; the first finger's first."""
        out = []
        for name in sorted(touches):
            if not touches[name].in_contact:
                continue
            try:
                out.append(self._checked(name, touches[name]))
            except ValueError as error:
                kind, reason = error.args
                if reason:
                    self._gates.refuse(kind, f"{f'finger {name}: ' if name else ''}{reason}")
        return out

    def _checked(self, name: str, touch: Measurement) -> Measurement:
        """Return a usable touch; raises ValueError(kind, reason), with an empty reason if only its map is missing."""
        if name != FIRST:
            touch = replace(touch, T_gel_finger=_checked_pose(touch.T_gel_finger))
        try:
            touch = replace(touch, code=self._model.measurement.unit_code(touch.code))
        except ValueError as error:
            raise ValueError("bad_code", str(error)) from error
        if self._model.alignment is None:
            return touch
        if touch.penetration is None:
            raise ValueError("no_map", "")
        shape = self._model.alignment.map_shape
        if touch.penetration.shape != shape or not np.isfinite(touch.penetration).all():
            raise ValueError("bad_relief", f"penetration map is not finite or not of shape {shape}")
        return touch


def by_name(measurement: Measurement, others: Mapping[str, Measurement]) -> dict[str, Measurement]:
    """Return all fingers' measurements, the first one's as `FIRST`; raises InputError if a further one has no name."""
    if FIRST in others:
        raise InputError("others: a further finger needs a name")
    return {FIRST: measurement, **others}


def _checked_pose(T_gel_finger: np.ndarray) -> np.ndarray:
    """Return the transform with an orthonormal rotation; raises ValueError(kind, reason) if it cannot be used."""
    try:
        motion = Odometry.from_matrix(T_gel_finger)
    except ValueError as error:
        raise ValueError("bad_finger_pose", str(error).replace("odometry", "pose")) from error
    if not motion.distance <= _LARGEST_HAND:
        raise ValueError("bad_finger_pose", f"pose is {motion.distance:.3g} m from the first finger's")
    if motion.distance < _ONE_SPOT and motion.transform[2, 2] > 0:
        raise ValueError("bad_finger_pose", "TF puts it where the first finger is: does it name the same frame?")
    return motion.transform
