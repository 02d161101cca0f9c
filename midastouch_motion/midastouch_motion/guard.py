"""What has to hold while an arm moves; what does not is the reason for which it stops.

This is no safety function: it is as reliable as the software that it runs in. Speed, force and stop of the arm itself
are what protects people.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from midastouch_common.errors import InputError


@dataclass
class Seen:
    """What is known at a moment. Times [s] of the newest `enable`, image, pose and wrench, -inf before the first; gel,
    its pose (4, 4) in the base frame; depth m; force N, of that wrench; lost, whether the filter says so; listeners and
    commanders of the twist topic, numbers of subscriptions and publishers."""

    enabled: float = -math.inf
    image: float = -math.inf
    pose: float = -math.inf
    wrench: float = -math.inf
    gel: np.ndarray = field(default_factory=lambda: np.eye(4))
    depth: float = 0.0
    force: float = 0.0
    lost: bool = False
    listeners: int = 0
    commanders: int = 0


@dataclass(frozen=True)
class Guard:
    """low, high (3,) m: the box in the base frame that the gel keeps to, and cone rad, the largest angle between the z
    axes of gel and base; depth m and force N, not to be exceeded, an infinite force is not looked at; hold and stale, s
    for which an `enable` holds, and after which images, poses and wrenches are too old; ahead, s that they may be ahead
    of the clock. Raises InputError for an empty box."""

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
            raise InputError(f"the box from {_in_mm(self.low)} to {_in_mm(self.high)} mm is empty")

    def problem(self, now: float, seen: Seen) -> str:
        """What is in the way of a motion, in words; empty if nothing is."""
        return self.stop(now, seen) or self.too_deep(seen) or self.too_strong(seen) or self.outside(seen)

    def stop(self, now: float, seen: Seen) -> str:
        """Why no motion may go on, wherever it leads, in words; empty if one may."""
        if abs(now - seen.enabled) > self.hold:  # where the clock was set back, nobody knows how long ago that was
            return "not enabled: ~/enable has to be repeated while the arm may move"
        if seen.listeners == 0:
            return "nobody follows the twists: is the arm's controller running, and its topic remapped?"
        if seen.commanders > 1:
            return "another node commands twists, too; stop it"
        needed = {"image": seen.image, "transform of the gel": seen.pose}
        if self.force < math.inf:
            needed["force on the topic wrench (needed by max_force)"] = seen.wrench
        for what, stamp in needed.items():
            if (age := now - stamp) > self.stale:
                return f"no {what} came yet" if age == math.inf else f"the newest {what} is {1e3 * age:.0f} ms old"
            if early := self.early(what, now, stamp):
                return early
        return "the filter is lost" if seen.lost else ""

    def early(self, what: str, now: float, stamp: float) -> str:
        """Why a stamp [s] that is ahead of `now` says nothing of how old something is, in words; empty if it is not."""
        early = stamp - now
        return f"the newest {what} is {1e3 * early:.0f} ms ahead of the clock" if early > self.ahead else ""

    def counted(self, now: float, stamp: float) -> float:
        """What a stamp [s] that has just come counts as: what is a little ahead of `now` is no younger than this."""
        return stamp if stamp - now > self.ahead else min(stamp, now)

    def too_deep(self, seen: Seen) -> str:
        """Why the gel has to be pulled back, in words; empty if it has not."""
        if seen.depth > self.depth:
            return f"{1e3 * seen.depth:.2f} mm deep, more than {1e3 * self.depth:.2f}"
        return ""

    def too_strong(self, seen: Seen) -> str:
        """Why the gel may only lead off the surface, in words; empty if it may go anywhere."""
        return f"a force of {seen.force:.1f} N, more than {self.force:.1f}" if seen.force > self.force else ""

    def outside(self, seen: Seen, twist: np.ndarray | None = None) -> str:
        """That the gel is outside of box or cone, in words, empty if it is not, or if a twist (6,) leads it back."""
        return self.outside_box(seen, twist) or self._outside_cone(seen.gel, twist)

    def outside_box(self, seen: Seen, twist: np.ndarray | None = None) -> str:
        """The same of the box alone."""
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
        """What leads straight off the surface is allowed everywhere: before, nothing can be turned back."""
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
