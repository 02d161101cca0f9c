"""A sensor's calibration, used as long as the gel is the one that it was made with."""

from __future__ import annotations

import numpy as np

from ..sensor_calibration.calibration import SensorCalibration, scale_problem
from ..sensor_model import SensorModel
from .depth_net import DepthNet


class CalibrationInUse:
    """Gives a calibration to a depth network, and takes it back where the no-contact image is another gel's.

    Args: tdn; calibration, of the same kind of sensor: of another scale, it is not given; sensor, tdn's, full size.
    Attribute: problem, why it is not used; empty if it is, or there is none.
    """

    def __init__(self, tdn: DepthNet | None, calibration: SensorCalibration | None, sensor: SensorModel):
        self._tdn, self._calibration = tdn, calibration
        self._other_scale = scale_problem(sensor, calibration.pixel_size) if calibration else ""
        self._decide(self._other_scale)

    def check(self, background: np.ndarray) -> None:
        """The no-contact image (H, W, 3) uint8 RGB in use from now on."""
        if self._calibration is not None:
            self._decide(self._other_scale or self._calibration.background_problem(background))

    def _decide(self, problem: str) -> None:
        self.problem = problem
        if self._calibration is not None:
            self._tdn.calibration = None if problem else self._calibration

    def __str__(self) -> str:
        """What is in use, in words."""
        if self._calibration is None:
            return "none"
        if self.problem:
            return "refused"
        return f"{self._calibration.touched}, {self._calibration.date}"
