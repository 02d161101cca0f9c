"""Conditions that must hold while an arm moves; the arm stops with the one that fails as the reason.

This is no safety function: it is as reliable as the software that it runs in. The arm's own limits of speed and force
and its stop protect people.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from midastouch_common.errors import InputError
from midastouch_perception.contact import ContactState

UNREAD = {
    ContactState.SATURATED.value: "the contact covers the view: how deep it is cannot be seen",
    ContactState.UNKNOWN.value: "the image shows neither a contact nor a free gel",
}
"""Why an image does not show the depth, by the state of its contact; other states do."""

_NOT_ENABLED = "not enabled: ~/enable has to be repeated while the arm may move"


@dataclass
class Seen:
    """Input of the guard at a moment. Times [s] of the newest `enable`, image, pose and wrench, -inf before the
    first; gel, its pose (4, 4) in the base frame; depth [m]; unread, why the image does not show the depth, empty if
    it does; force [N] of that wrench; bad_wrench, why the wrench cannot be used, empty if it can; lost, whether the
    filter is; listeners and commanders, numbers of nodes that follow twists on their topic, and that publish them."""

    enabled: float = -math.inf
    image: float = -math.inf
    pose: float = -math.inf
    wrench: float = -math.inf
    gel: np.ndarray = field(default_factory=lambda: np.eye(4))
    depth: float = 0.0
    unread: str = ""
    force: float = 0.0
    bad_wrench: str = ""
    lost: bool = False
    listeners: int = 0
    commanders: int = 0


@dataclass(frozen=True)
class Guard:
    """Limits of motions. low, high (3,) [m]: box in the base frame that the gel keeps to; cone [rad]: largest angle
    between the z axes of gel and base; depth [m], force [N]: limits, an infinite force is not checked; hold [s]: how
    long an `enable` holds; stale [s]: age from which images, poses and wrenches are too old; ahead [s]: how far they
    may be ahead of the clock. Raises InputError for an empty box."""

    low: np.ndarray
    high: np.ndarray
    depth: float
    hold: float = 0.1
    stale: float = 0.1
    ahead: float = 0.1
    force: float = math.inf
    cone: float = math.pi

    def __post_init__(self) -> None:
        if not (np.asarray(self.low) < self.high).all():
            box = f"{_in_mm(self.low)} to {_in_mm(self.high)} mm"
            raise InputError(f"the box from {box} is empty: where may the arm move? Give box_low and box_high")

    def problem(self, now: float, seen: Seen) -> str:
        """Return what is in the way of a motion; empty if nothing is.

        Parameters
        ----------
        now : [s]
        seen
        """
        return (
            self.stop(now, seen)
            or self.late(now, seen)
            or self.too_deep(seen)
            or seen.unread
            or self.too_strong(seen)
            or self.outside(seen)
        )

    def stop(self, now: float, seen: Seen) -> str:
        """Return why a motion must end, wherever it leads; empty if it need not.

        Parameters
        ----------
        now : [s]
        seen
        """
        if seen.enabled == -math.inf:
            return _NOT_ENABLED
        if seen.listeners == 0:
            return "nothing subscribes to the twists: is the arm's controller running, and its topic remapped?"
        if seen.commanders > 1:
            return "another node commands twists, too; stop it"
        for what, stamp in self._needed(seen).items():
            if early := self.early(what, now, stamp):
                return early
        return seen.bad_wrench or ("the filter is lost" if seen.lost else "")

    def late(self, now: float, seen: Seen) -> str:
        """Return what has not come in time, and is waited for at rest; empty if nothing is late.

        Parameters
        ----------
        now : [s]
        seen
        """
        if abs(now - seen.enabled) > self.hold:  # abs: if the clock was set back, the age of an `enable` is unknown
            return _NOT_ENABLED
        for what, stamp in self._needed(seen).items():
            if (age := now - stamp) > self.stale:
                return f"no {what} came yet" if age == math.inf else f"the newest {what} is {1e3 * age:.0f} ms old"
        return ""

    def _needed(self, seen: Seen) -> dict[str, float]:
        """Return the stamps of what a motion needs, by name."""
        needed = {"image": seen.image, "transform of the gel": seen.pose}
        if self.force < math.inf or seen.wrench > -math.inf:  # an arm that gave its force goes on to
            needed["force on wrench_topic"] = seen.wrench
        return needed

    def early(self, what: str, now: float, stamp: float) -> str:
        """Return why a stamp is too far ahead of `now` to show how old something is; empty if it is not.

        Parameters
        ----------
        what
            Name of the data, for the message.
        now, stamp : [s]
        """
        early = stamp - now
        return f"the newest {what} is {1e3 * early:.0f} ms ahead of the clock" if early > self.ahead else ""

    def counted(self, now: float, stamp: float) -> float:
        """Clamp a stamp that is slightly ahead to `now`, so that a fast clock does not make data look newer.

        Parameters
        ----------
        now, stamp : [s]

        Returns
        -------
        [s]
        """
        return stamp if stamp - now > self.ahead else min(stamp, now)

    def too_deep(self, seen: Seen) -> str:
        """Return why the gel must be pulled back; empty if it need not be."""
        return f"{1e3 * seen.depth:.2f} mm deep, more than {1e3 * self.depth:.2f}" if seen.depth > self.depth else ""

    def too_strong(self, seen: Seen) -> str:
        """Return why the gel may only leave the surface; empty if it may go anywhere."""
        return f"a force of {seen.force:.1f} N, more than {self.force:.1f}" if seen.force > self.force else ""

    def outside(self, seen: Seen, twist: np.ndarray | None = None) -> str:
        """Return that the gel is outside of box or cone; empty if it is not, or if a twist leads it back.

        Parameters
        ----------
        seen
        twist : (6,) in the gel's frame
        """
        return self.outside_box(seen, twist) or self._outside_cone(seen.gel, twist)

    def outside_box(self, seen: Seen, twist: np.ndarray | None = None) -> str:
        """Return the same for the box alone.

        Parameters
        ----------
        seen, twist
            As for `outside`.
        """
        gel, position = seen.gel, seen.gel[:3, 3]
        out = (position > self.high).astype(int) - (position < self.low)
        if not out.any():
            return ""
        if twist is not None:
            outwards = out * (gel[:3, :3] @ twist[:3])
            if not twist.any() or ((outwards <= 0).all() and (outwards < 0).any()):
                return ""
        return f"the gel is at {_in_mm(position)} mm, outside of the box"

    def _outside_cone(self, gel: np.ndarray, twist: np.ndarray | None) -> str:
        """Return the same for the cone alone. The way straight off the surface is always free: a turn back needs it."""
        angle = math.acos(min(max(gel[2, 2], -1.0), 1.0))
        if angle <= self.cone:
            return ""
        if twist is not None:
            upwards = gel[2, 0] * twist[4] - gel[2, 1] * twist[3]  # change of the z axis along the base's
            beside = twist[:2].any() or twist[3:].any()
            if upwards > 0 or (twist[2] >= 0 and not beside):
                return ""
        return f"the gel is tilted by {math.degrees(angle):.0f} deg, outside of the cone"


def _in_mm(position: np.ndarray) -> str:
    return "(" + ", ".join(f"{1e3 * value:.0f}" for value in position) + ")"
