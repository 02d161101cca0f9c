"""What the two perception nodes do to one frame, without ROS: image -> penetration -> code."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..contact import Contact, ContactDetector


@dataclass(frozen=True)
class Depth:
    """Result of the depth stage for one image.

    contact; penetration (H, W) float32 [m], zero outside the contact; skipped: the image was the last one
    again, so that the last result was taken.
    """

    contact: Contact
    penetration: np.ndarray
    skipped: bool


class DepthStage:
    """Image and background -> penetration in the contact. An unchanged image costs one comparison."""

    def __init__(self, tdn, detector: ContactDetector):
        self._tdn, self._detector = tdn, detector
        self._image: np.ndarray | None = None
        self._background: np.ndarray | None = None
        self._last: Depth | None = None

    def process(self, image: np.ndarray, background: np.ndarray) -> Depth:
        """`image`, `background` (H, W, 3) uint8 RGB of the sensor's full size."""
        if self._last is not None and background is self._background and np.array_equal(image, self._image):
            return Depth(self._last.contact, self._last.penetration, skipped=True)
        penetration = self._tdn.predict(image, background)
        contact = self._detector.update(penetration)
        self._image, self._background = image, background
        touching = contact.mask & contact.in_contact
        self._last = Depth(contact, np.where(touching, penetration, np.float32(0)), skipped=False)
        return self._last


@dataclass(frozen=True)
class Code:
    """Result of the code stage: `values` (D,) float32, L2-normalised; empty without contact."""

    in_contact: bool
    area_m2: float
    values: np.ndarray
    network_id: str


class CodeStage:
    """Penetration in the contact -> code. No contact and an unchanged map cost nothing but their test.

    `skipped` counts both gates.
    """

    def __init__(self, tcn):
        self._tcn = tcn
        self._penetration: np.ndarray | None = None
        self._values = np.zeros(0, np.float32)
        self.skipped = {"no_contact": 0, "cloud_unchanged": 0}

    def process(self, penetration: np.ndarray, area_m2: float) -> Code:
        """`penetration` (H, W) float32 [m], zero outside the contact of area `area_m2`."""
        if not penetration.any():
            self.skipped["no_contact"] += 1
            return Code(False, 0.0, np.zeros(0, np.float32), self._tcn.network_id)
        if self._penetration is not None and np.array_equal(penetration, self._penetration):
            self.skipped["cloud_unchanged"] += 1
        else:
            self._values = np.asarray(self._tcn.encode(penetration), np.float32)
            self._penetration = penetration
        return Code(True, area_m2, self._values, self._tcn.network_id)
