"""Pipeline from a tactile image to the filter's input, one frame at a time; nodes and evaluation both use it.

    image, background -> DepthStage -> Contact -> CodeStage -> TouchReading

A cloud carries a contact's penetration map to the last bit (`pointcloud`). So the result is the same whether both
stages run in one process or on two sides of a topic.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import cv2
import numpy as np

from .contact import Contact, ContactDetector
from .gel_texture import GelCheck
from .tcn.inference import AnyCodeNet
from .tdn.background import TouchedBackground, shows_contact
from .tdn.depth_net import DepthNet
from .tdn.fit_check import FitCheck, explained_fraction
from .tdn.inputs import LightDrift

_BLOCK = 8  # px; noise averages out over a block, a contact does not
_EXPLAINED_BY_CONTACT = 0.6
"""Smallest fraction of a change that a contact's shape explains. It lies between the smallest of real presses, even
faint ones, and of touches on measured gel (0.70), and the largest of simulated slow changes of the light (0.51)."""
_WHOLE_GEL = 0.95  # of the image; a larger contact is a change of the light everywhere
_ASKED_EVERY = 10  # frames of a contact between checks, because light may change while it lasts
_QUIET_LEVEL = 1.2  # grey levels, largest block-mean difference to the background that still counts as none


@dataclasses.dataclass(frozen=True)
class TouchReading:
    """One perceived frame: contact; code (D,) float32, L2-normalised, or None without contact; network_id of the code
    network."""

    contact: Contact
    code: np.ndarray | None
    network_id: str


class DepthStage:
    """Stage from image and background to contact.

    An unchanged image costs one comparison. A frame that does not differ from the background skips the network; frames
    without contact teach the stage the drift of the light.

    Args: tdn; fit, touched and gel, the checks that `deferred_update` feeds, or None.
    Attributes: skipped, number of frames that skipped the network, by reason.
    """

    def __init__(
        self,
        tdn: DepthNet,
        fit: FitCheck | None = None,
        touched: TouchedBackground | None = None,
        gel: GelCheck | None = None,
    ):
        self._tdn, self._fit, self._touched, self._gel = tdn, fit, touched, gel
        self._detector = ContactDetector(tdn.sensor)
        self._drift = LightDrift()
        self._image: np.ndarray | None = None
        self._background: np.ndarray | None = None
        self._last: Contact | None = None
        self._unchecked: tuple[np.ndarray, ...] | None = None
        self._asked = 0
        self.skipped = {"image_unchanged": 0, "no_contact": 0}

    def process(self, image: np.ndarray, background: np.ndarray) -> Contact:
        """Return the contact in one image; both images (320, 240, 3) uint8 RGB. InputError for a bad image.

        The image is kept to be compared with the next one: do not write into it.
        """
        same_background = background is self._background
        if same_background and self._last is not None and np.array_equal(image, self._image):
            self.skipped["image_unchanged"] += 1
            return self._last
        changed = self._tdn.change(image, background)
        if not same_background:
            self._drift = LightDrift()
        contact = self._contact(image, background, changed)
        if not contact.in_contact:
            self._drift.learn(changed)
        self._image, self._background, self._last = image, background, contact
        return contact

    def _contact(self, image: np.ndarray, background: np.ndarray, seen: np.ndarray) -> Contact:
        changed = self._drift.correct(seen)
        height, width = changed.shape[:2]
        blocks = cv2.resize(changed, (width // _BLOCK, height // _BLOCK), interpolation=cv2.INTER_AREA)
        if np.abs(blocks).max() < _QUIET_LEVEL:
            self.skipped["no_contact"] += 1
            return self._detector.free()
        difference = self._tdn.shown(changed)
        penetration = self._tdn.predict(image, background, difference)
        self._unchecked = seen, difference, penetration, image, background
        contact = self._detector.update(penetration)
        if not contact.in_contact:
            return contact
        if self._is_light(difference, penetration):
            return self._detector.free()
        return dataclasses.replace(contact, depth_m=self._tdn.depth(difference, contact.penetration))

    def _is_light(self, difference: np.ndarray, penetration: np.ndarray) -> bool:
        """Return whether only the lamps changed: no shape explains the change, or it has no outline in view.

        This is checked when a contact begins, and now and then. A simulator's lamps do not change.
        """
        self._asked = (self._asked + 1) % _ASKED_EVERY if self._last is not None and self._last.in_contact else 0
        if self._asked or self._tdn.sensor.light != "relative":
            return False
        if (penetration > 0).mean() > _WHOLE_GEL:
            return True
        explained = explained_fraction(difference, penetration, self._tdn.sensor.pixel_size, least_change=0.0)
        return explained is not None and explained < _EXPLAINED_BY_CONTACT

    def deferred_update(self) -> None:
        """Give the last frame to the checks, if it went through the network.

        You need not call this; if you do, call it after the contact is published, which does not depend on the checks.
        """
        if self._unchecked is None:
            return
        (change, difference, penetration, image, background), self._unchecked = self._unchecked, None
        if self._fit is not None:
            self._fit.observe(change, difference, penetration)
        if self._touched is not None:
            self._touched.observe(image, background)
        if self._gel is not None:
            self._gel.observe(image, background, penetration)

    def shows_contact(self, candidate: np.ndarray, background: np.ndarray) -> bool:
        """Return whether a candidate no-contact image is `background` with an object pressed onto the gel."""
        return shows_contact(self._tdn, candidate, background)


class CodeStage:
    """Stage from contact to touch with its code. A frame without contact, or with an unchanged map, costs only a test.

    Attributes: skipped, number of frames that skipped the network, by reason.
    """

    def __init__(self, tcn: AnyCodeNet):
        self._tcn = tcn
        self._penetration: np.ndarray | None = None
        self._code: np.ndarray | None = None
        self.skipped = {"no_contact": 0, "cloud_unchanged": 0}

    def process(self, contact: Contact) -> TouchReading:
        """Process one frame, whose map has the resolution of the network's sensor."""
        if not contact.in_contact:
            self.skipped["no_contact"] += 1
            return TouchReading(contact, None, self._tcn.network_id)
        if self._penetration is not None and np.array_equal(contact.penetration, self._penetration):
            self.skipped["cloud_unchanged"] += 1
        else:
            self._code = np.asarray(self._tcn.encode(contact.penetration), np.float32)
            self._penetration = contact.penetration
        return TouchReading(contact, self._code, self._tcn.network_id)


class TouchPipeline:
    """Both stages as one object, for runs without ROS.

    Args: clock, monotonic seconds. Attributes: ms, wall time [ms] of the stages tdn and tcn in the last frame.
    """

    def __init__(self, tdn: DepthNet, tcn: AnyCodeNet, clock: Callable[[], float]):
        self._depth, self._code, self._clock = DepthStage(tdn), CodeStage(tcn), clock
        self.ms: dict[str, float] = {}

    def process(self, image: np.ndarray, background: np.ndarray) -> TouchReading:
        """Process one frame: image and background (320, 240, 3) uint8 RGB; InputError for a bad image."""
        start = self._clock()
        contact = self._depth.process(image, background)
        middle = self._clock()
        touch = self._code.process(contact)
        self.ms = {"tdn": 1e3 * (middle - start), "tcn": 1e3 * (self._clock() - middle)}
        return touch
