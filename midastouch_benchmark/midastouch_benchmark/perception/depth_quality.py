"""Errors of predicted penetration maps, and the effect of a change of exposure on them."""

from __future__ import annotations

from collections.abc import Mapping

import cv2
import numpy as np

from midastouch_perception.contact import TOUCHED
from midastouch_perception.sensor_calibration.calibration import SensorCalibration
from midastouch_perception.tdn import DepthNet
from midastouch_tools.datasets.ball_presses import BallPresses


class DepthQuality:
    """Accumulator of errors over the frames of a sequence, at the truth's resolution."""

    def __init__(self) -> None:
        self.frames = 0
        self._squares, self._pixels = 0.0, 0
        self._contact_squares, self._contact_pixels = 0.0, 0
        self._both, self._either = 0, 0

    def add(self, predicted: np.ndarray, truth: np.ndarray) -> None:
        """Add one frame: penetration maps [m]; the prediction (h, w) is enlarged bilinearly to the truth's (H, W)."""
        enlarged = cv2.resize(predicted, truth.shape[::-1], interpolation=cv2.INTER_LINEAR)
        squares = (enlarged.astype(float) - truth) ** 2
        contact, claimed = truth >= TOUCHED, enlarged >= TOUCHED
        self.frames += 1
        self._squares += squares.sum()
        self._pixels += squares.size
        self._contact_squares += squares[contact].sum()
        self._contact_pixels += int(contact.sum())
        self._both += int((contact & claimed).sum())
        self._either += int((contact | claimed).sum())

    def result(self) -> dict[str, float]:
        """Return RMSE [mm] over all pixels and over the truly touched ones, and IoU of the contact over all frames."""
        return {
            "frames": self.frames,
            "rmse_mm": 1e3 * _root_mean(self._squares, self._pixels),
            "contact_rmse_mm": 1e3 * _root_mean(self._contact_squares, self._contact_pixels),
            "contact_iou": self._both / self._either if self._either else float("nan"),
        }

    def merge(self, other: DepthQuality) -> None:
        """Add another sequence's pixels to this one's."""
        for name, value in vars(other).items():
            setattr(self, name, getattr(self, name) + value)


def _root_mean(total: float, count: int) -> float:
    return float(np.sqrt(total / count)) if count else float("nan")


CHANGES = 0.9, 1.1


def brightness_effect(
    tdn: DepthNet, presses: BallPresses, calibrations: Mapping[str, SensorCalibration] | None = None
) -> float:
    """Return the root mean square over all pixels [m] by which the map of a press changes with its brightness.

    Of each press the larger effect of the two `CHANGES` counts; the result is the median over presses. The no-contact
    image stays as it is; calibrations: of each press, as in `measure_presses`.
    """
    effects = []
    for name, image in presses.images.items():
        if calibrations is not None:
            tdn.calibration = calibrations[name]
        measured = tdn.predict(image, presses.background)
        changed = [np.clip(np.rint(factor * image.astype(np.float32)), 0, 255).astype(np.uint8) for factor in CHANGES]
        errors = [tdn.predict(other, presses.background) - measured for other in changed]
        effects.append(max(float(np.sqrt(np.mean(error**2))) for error in errors))
    return float(np.median(effects))
