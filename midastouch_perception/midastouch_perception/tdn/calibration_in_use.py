"""A sensor's calibration, used as long as the gel is the one that it was made with."""

from __future__ import annotations

import numpy as np

from ..sensor_calibration import SensorCalibration
from .depth_net import DepthNet


class CalibrationInUse:
    """Gives a calibration to a depth network, and takes it back where the no-contact image is another gel's.

    Attribute: problem, why it is not used; empty if it is, or there is none.
    """

    def __init__(self, tdn: DepthNet | None, calibration: SensorCalibration | None):
        self._tdn, self._calibration = tdn, calibration
        self.problem = ""
        if calibration is not None:
            tdn.calibration = calibration

    def check(self, background: np.ndarray) -> None:
        """The no-contact image (H, W, 3) uint8 RGB in use from now on."""
        if self._calibration is not None:
            self.problem = self._calibration.background_problem(background)
            self._tdn.calibration = None if self.problem else self._calibration

    def __str__(self) -> str:
        """What is in use, in words."""
        if self._calibration is None:
            return "none"
        if self.problem:
            return "refused"
        return f"{self._calibration.touched}, {self._calibration.date}"
