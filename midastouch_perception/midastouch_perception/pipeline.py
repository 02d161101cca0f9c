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

from .contact import Contact, ContactDetector, ContactState
from .gel_texture import GelCheck
from .tcn.inference import AnyCodeNet
from .tdn.background import TouchedBackground, shows_contact
from .tdn.depth_net import DepthNet
from .tdn.fit_check import FitCheck, explained_fraction
from .tdn.inputs import LightDrift
from .tdn.lamp_light import LampLight, Unexplained

_BLOCK = 8  # px; noise averages out over a block, a contact does not
_EXPLAINED_BY_CONTACT = 0.6
"""Smallest fraction of a change that a contact's shape explains. It lies between the smallest of real presses, even
faint ones, and of touches on measured gel (0.70), and the largest of simulated slow changes of the light (0.51)."""
_COVERED = 0.85  # of the image; too little of a larger contact's outline is in view
_SHAPED_LEVEL = 1.5  # grey levels, least root mean square beside the lamps' light of a change that only a contact makes
_BEGINS = 0.5
"""Least fraction of a change's energy beside the lamps' light with which a contact begins. First touches have 0.66 or
more, and broad lobes of the lamps up to 0.48."""
_RELEASED = 0.5
"""Of the largest level since the gel was free: a contact that has shrunk to less, and is not seen, has ended, and left
marks in the gel. A flat face pressed onto flat gel keeps 0.7 or more."""
_QUIET_LEVEL = 1.2  # grey levels, largest block-mean difference to the background that still counts as none


@dataclasses.dataclass(frozen=True)
class TouchReading:
    """One perceived frame: contact; code (D,) float32, L2-normalised, or None without contact; network_id of the code
    network."""

    contact: Contact
    code: np.ndarray | None
    network_id: str


class DepthStage:
    """Stage from image and background to contact (paper section 4.1).

    An unchanged image costs one comparison. A frame that does not differ from the background skips the network; frames
    without contact teach the stage the drift of the light. The attribute `skipped` counts frames that skipped the
    network, by reason.

    Parameters
    ----------
    tdn
    fit, touched, gel
        Checks that `deferred_update` feeds, or None.
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
        self._lamps: LampLight | None = None  # those of a simulator do not change
        self._most_left = 0.0  # level since the gel was free
        self._begun = False  # whether there was a contact since then
        self._image: np.ndarray | None = None
        self._background: np.ndarray | None = None
        self._last: Contact | None = None
        self._unchecked: tuple[np.ndarray, ...] | None = None
        self.skipped = {"image_unchanged": 0, "no_contact": 0}

    def process(self, image: np.ndarray, background: np.ndarray) -> Contact:
        """Find the contact in one image.

        Parameters
        ----------
        image
            (320, 240, 3) uint8 RGB. It is kept to be compared with the next one: do not write into it.
        background
            No-contact image of the same form.

        Returns
        -------
        Contact
            Penetration map (160, 120) [m] and figures of it.

        Raises
        ------
        InputError
            An image of another size or type.
        """
        same_background = background is self._background
        if same_background and self._last is not None and np.array_equal(image, self._image):
            self.skipped["image_unchanged"] += 1
            return self._last
        changed = self._tdn.change(image, background)
        if not same_background:
            self._drift = LightDrift()
            self._lamps = LampLight(background) if self._tdn.sensor.light == "relative" else None
        contact = self._contact(image, background, changed)
        if contact.state == ContactState.FREE:
            self._drift.learn(changed)
            self._most_left, self._begun = 0.0, False
            if self._lamps is not None:
                self._lamps.learn()
        self._begun |= contact.state == ContactState.CONTACT
        self._image, self._background, self._last = image, background, contact
        return contact

    def _contact(self, image: np.ndarray, background: np.ndarray, seen: np.ndarray) -> Contact:
        changed = self._drift.correct(seen)
        left = None if self._lamps is None else self._lamps.unexplained(image)
        height, width = changed.shape[:2]
        blocks = cv2.resize(changed, (width // _BLOCK, height // _BLOCK), interpolation=cv2.INTER_AREA)
        if np.abs(blocks).max() < _QUIET_LEVEL and not (left and left.detailed):
            self.skipped["no_contact"] += 1
            return self._detector.no_contact()
        difference = self._tdn.shown(changed)
        penetration = self._tdn.predict(image, background, difference)
        self._unchecked = seen, difference, penetration, image, background
        contact = self._detector.update(penetration)
        if contact.in_contact and (penetration > 0).mean() > _COVERED:
            contact = dataclasses.replace(contact, state=ContactState.SATURATED)
        state = contact.state if left is None else self._state(contact, difference, penetration, left)
        if state in (ContactState.FREE, ContactState.UNKNOWN):
            return self._detector.no_contact(state)
        depth = self._tdn.depth(difference, contact.penetration)
        # with too few slopes in view, the reading does not grow with the press
        if self._last is not None and (state == ContactState.SATURATED or contact.grown_from(self._last)):
            depth = max(depth, self._last.depth_m)
        return dataclasses.replace(contact, depth_m=depth, state=state)

    def _state(
        self, found: Contact, difference: np.ndarray, penetration: np.ndarray, left: Unexplained
    ) -> ContactState:
        """Return what a frame shows: what the network has found, or the light of the lamps alone, or neither.

        A contact begins with its outline in view, by a change that no lamp makes or that a shape explains. It lasts as
        long as such a change does, also one that covers the view; its depth is read again only after what also begins
        one, because the outline of something flat flickers, or from a texture. What is there from the first frame on,
        unexplained, may be a no-contact image of another gel. The gel is free if the lamps explain the image, not if
        nothing is found.
        """
        self._most_left = max(self._most_left, left.level)
        covered = found.state == ContactState.SATURATED
        before = ContactState.FREE if self._last is None else self._last.state
        if found.in_contact:
            begins = self._lamps.frames > 0 and not covered and left.fraction > _BEGINS
            shaped = left.level > _SHAPED_LEVEL and (before == ContactState.CONTACT or begins)
            if shaped or (self._begun and left.detailed):
                return found.state
            if not covered:
                explained = explained_fraction(difference, penetration, self._tdn.sensor.pixel_size, least_change=0.0)
                if explained is None or explained >= _EXPLAINED_BY_CONTACT:
                    return found.state
        released = not found.in_contact and left.level < _RELEASED * self._most_left
        if left.usual or released:
            return ContactState.FREE
        lasts = found.in_contact and before == ContactState.SATURATED
        return ContactState.SATURATED if lasts else ContactState.UNKNOWN

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
        """Return whether a candidate no-contact image shows an object pressed onto the gel.

        Parameters
        ----------
        candidate, background : (320, 240, 3) uint8 RGB
            The candidate, and the no-contact image of the untouched gel.
        """
        return shows_contact(self._tdn, candidate, background)


class CodeStage:
    """Stage from contact to touch with its code (paper section 4.2).

    A frame without contact, or with an unchanged map, costs only a test. The attribute `skipped` counts frames that
    skipped the network, by reason.

    Parameters
    ----------
    tcn
    """

    def __init__(self, tcn: AnyCodeNet):
        self._tcn = tcn
        self._penetration: np.ndarray | None = None
        self._code: np.ndarray | None = None
        self.skipped = {"no_contact": 0, "cloud_unchanged": 0}

    def process(self, contact: Contact) -> TouchReading:
        """Add the code to a contact.

        Parameters
        ----------
        contact
            Its map has the resolution of the network's sensor.
        """
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

    The attribute `ms` holds the wall time [ms] of the stages tdn and tcn in the last frame.

    Parameters
    ----------
    tdn, tcn
        Networks, from `load_tdn` and `load_tcn`.
    clock
        Function that returns monotonic seconds.
    """

    def __init__(self, tdn: DepthNet, tcn: AnyCodeNet, clock: Callable[[], float]):
        self._depth, self._code, self._clock = DepthStage(tdn), CodeStage(tcn), clock
        self.ms: dict[str, float] = {}

    def process(self, image: np.ndarray, background: np.ndarray) -> TouchReading:
        """Process one frame.

        Parameters
        ----------
        image, background : tactile image and no-contact image, (320, 240, 3) uint8 RGB

        Raises
        ------
        InputError
            An image of another size or type.
        """
        start = self._clock()
        contact = self._depth.process(image, background)
        middle = self._clock()
        touch = self._code.process(contact)
        self.ms = {"tdn": 1e3 * (middle - start), "tcn": 1e3 * (self._clock() - middle)}
        return touch
