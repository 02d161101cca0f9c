"""From a tactile image to what the filter needs, one frame at a time."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import cv2
import numpy as np

from .contact import Contact, ContactDetector
from .tcn.inference import TactileCodeNet
from .tdn.background import shows_contact
from .tdn.depth_net import DepthNet
from .tdn.drift import LightDrift
from .tdn.fit_check import FitCheck

_BLOCK = 8  # px; noise averages out over a block, a contact does not


@dataclasses.dataclass(frozen=True)
class Touch:
    """One perceived frame.

    Attributes: in_contact; area_m2; code (D,) float32 or None without contact; penetration (160, 120) float32 m;
    network_id of the code; ms, wall time of the stages tdn and tcn.
    """

    in_contact: bool
    area_m2: float
    code: np.ndarray | None
    penetration: np.ndarray
    network_id: str
    ms: dict[str, float]


class DepthStage:
    """Image -> penetration and contact. Frames that do not differ from the background skip the network, and teach the
    stage how the light drifts.

    Args: tdn; contact, default for the network's sensor; quiet, largest block-mean difference [grey levels] to the
    background that still counts as none; fit, a check that is shown what the network makes of the images.
    Attributes: skipped, number of frames the gate kept from the network.
    """

    def __init__(
        self,
        tdn: DepthNet,
        contact: ContactDetector | None = None,
        quiet: float = 1.2,
        fit: FitCheck | None = None,
    ):
        self.tdn, self._fit = tdn, fit
        self._contact = contact or ContactDetector(tdn.sensor)
        self._quiet = quiet
        self._background: np.ndarray | None = None
        self._drift = LightDrift()
        self.skipped = 0

    def process(self, image: np.ndarray, background: np.ndarray) -> tuple[np.ndarray, Contact]:
        """Penetration (160, 120) float32 m and the contact in one image; InputError for a bad image."""
        changed = self.tdn.difference(image, background)
        if background is not self._background:
            self._background, self._drift = background, LightDrift()
        difference = self._drift.correct(changed)
        shape = difference.shape[:2]
        blocks = cv2.resize(difference, (shape[1] // _BLOCK, shape[0] // _BLOCK), interpolation=cv2.INTER_AREA)
        if np.abs(blocks).max() < self._quiet:
            self.skipped += 1
            self._contact.free()
            self._drift.learn(changed)
            return np.zeros(shape, np.float32), Contact(False, 0.0, np.zeros(shape, bool))
        penetration = self.tdn.predict(image, background, difference)
        if self._fit is not None:
            self._fit.observe(difference, penetration)
        contact = self._contact.update(penetration)
        if not contact.in_contact:
            self._drift.learn(changed)
        return penetration, contact

    def shows_contact(self, candidate: np.ndarray, background: np.ndarray) -> bool:
        """Whether an image offered as no-contact image is `background` with something pressed onto the gel."""
        return shows_contact(self.tdn, candidate, background)


class TouchPipeline:
    """Image -> penetration -> contact -> code, as one object for offline runs and the all-in-one node.

    Args: depth, the first stage; tcn; clock, monotonic seconds, for the times per stage.
    """

    def __init__(self, depth: DepthStage, tcn: TactileCodeNet, clock: Callable[[], float]):
        self.depth, self.tcn, self._clock = depth, tcn, clock

    def process(self, image: np.ndarray, background: np.ndarray) -> Touch:
        """One frame; InputError for a bad image."""
        start = self._clock()
        penetration, contact = self.depth.process(image, background)
        middle = self._clock()
        # what the code network sees is what the contact cloud carries: touched pixels only
        code = self.tcn.encode(np.where(contact.mask, penetration, 0)) if contact.in_contact else None
        end = self._clock()
        return Touch(
            contact.in_contact,
            contact.area_m2,
            code,
            penetration,
            self.tcn.network_id,
            {"tdn": 1e3 * (middle - start), "tcn": 1e3 * (end - middle)},
        )
