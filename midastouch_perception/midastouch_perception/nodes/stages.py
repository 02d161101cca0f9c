"""What the two perception nodes do to one frame, without ROS: image -> penetration -> code."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..pipeline import DepthStage
from ..tcn import TactileCodeNet
from .steps import in_steps


@dataclass(frozen=True)
class Depth:
    """What is known of one image: in_contact, area_m2, penetration (H, W) float32 m, 0 outside contact."""

    in_contact: bool
    area_m2: float
    penetration: np.ndarray


class ImageStage:
    """Image and background -> penetration in the contact. An unchanged image costs one comparison.

    `skipped` counts the frames that each gate kept from the network.
    """

    def __init__(self, depth: DepthStage):
        self._depth = depth
        self._image: np.ndarray | None = None
        self._background: np.ndarray | None = None
        self._last: Depth | None = None
        self._unchanged = 0

    @property
    def skipped(self) -> dict[str, int]:
        """Frames by the gate that spared them the network."""
        return {"image_unchanged": self._unchanged, "no_contact": self._depth.skipped}

    def process(self, image: np.ndarray, background: np.ndarray) -> Depth:
        """`image`, `background` (H, W, 3) uint8 RGB of the sensor's full size."""
        same_background = background is self._background
        if self._last is not None and same_background and np.array_equal(image, self._image):
            self._unchanged += 1
            return self._last
        penetration, contact = self._depth.process(image, background)
        self._image, self._background = image, background
        if contact.in_contact:
            masked = in_steps(np.where(contact.mask, penetration, np.float32(0)))
            self._last = Depth(True, contact.area_m2, masked)
        else:
            self._last = Depth(False, 0.0, np.zeros_like(penetration))
        return self._last


@dataclass(frozen=True)
class Code:
    """What is known of one touch: `values` (D,) float32, L2-normalised, empty without contact; penetration
    (H, W) float32 m that it was computed from."""

    in_contact: bool
    area_m2: float
    values: np.ndarray
    network_id: str
    penetration: np.ndarray


class CodeStage:
    """Penetration in the contact -> code. No contact and an unchanged map cost nothing but their test.

    `skipped` counts the frames that each gate kept from the network.
    """

    def __init__(self, tcn: TactileCodeNet):
        self._tcn = tcn
        self._penetration: np.ndarray | None = None
        self._values = np.zeros(0, np.float32)
        self.skipped = {"no_contact": 0, "cloud_unchanged": 0}

    def process(self, penetration: np.ndarray, area_m2: float) -> Code:
        """`penetration` (H, W) float32 [m], zero outside the contact of area `area_m2`."""
        penetration = in_steps(penetration)
        if not penetration.any():
            self.skipped["no_contact"] += 1
            return Code(False, 0.0, np.zeros(0, np.float32), self._tcn.network_id, penetration)
        if self._penetration is not None and np.array_equal(penetration, self._penetration):
            self.skipped["cloud_unchanged"] += 1
        else:
            self._values = np.asarray(self._tcn.encode(penetration), np.float32)
            self._penetration = penetration
        return Code(True, area_m2, self._values, self._tcn.network_id, penetration)
