"""How close predicted penetration maps are to the truth."""

from __future__ import annotations

import cv2
import numpy as np

from midastouch_perception.contact import TOUCHED


class DepthQuality:
    """Accumulates errors over the frames of a sequence, at the truth's resolution."""

    def __init__(self) -> None:
        self.frames = 0
        self._squares, self._pixels = 0.0, 0
        self._contact_squares, self._contact_pixels = 0.0, 0
        self._both, self._either = 0, 0

    def add(self, predicted: np.ndarray, truth: np.ndarray) -> None:
        """One frame: penetration maps [m], the prediction (h, w) enlarged bilinearly to the truth's (H,
        W)."""
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
        """RMSE [mm] over all pixels and over the truly touched ones, and IoU of the contact over all
        frames."""
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
