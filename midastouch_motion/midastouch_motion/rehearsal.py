"""The loop closed in simulated time: an arm, the images of its sensor, which come late, and the controller."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np

from .contact_servo import Measured
from .controller import Controller
from .guard import Seen
from .skills import Ended, Skill

PERIOD = 0.01
"""s between two twists, as of the node `slider`."""


class Arm(Protocol):
    """What follows twists (6,) in the gel's frame. advance: its pose T_base_gel (4, 4) at a time [s]."""

    def command(self, now: float, twist: np.ndarray) -> None: ...

    def advance(self, now: float) -> np.ndarray: ...


class Moment(NamedTuple):
    """After a period: time [s]; twist (6,) that was commanded; where, T_obj_gel (4, 4), the gel is; whether an image
    was taken."""

    time: float
    twist: np.ndarray
    where: np.ndarray
    image: bool


class Rehearsal:
    """Carries out one motion after the other.

    Args: arm; where(): T_obj_gel (4, 4) of its gel; look(T_obj_gel): depth [m], slope (2,) and centre (2,) m that an
    image there shows; controller; fps, images per second; delay(): s until an image is understood.
    Attributes: now [s]; seen, what the guard looks at, to inject a fault into: of `enabled`, `image`, `pose` and
    `gel` those that `frozen` names are not set anew.
    """

    def __init__(
        self,
        arm: Arm,
        where: Callable[[], np.ndarray],
        look: Callable[[np.ndarray], tuple[float, np.ndarray, np.ndarray]],
        controller: Controller,
        fps: float,
        delay: Callable[[], float],
    ):
        self._arm, self._where, self._look, self._controller = arm, where, look, controller
        self._fps, self._delay = fps, delay
        self._coming: deque[tuple[float, Measured]] = deque()
        self._due = self.now = 0.0
        self.seen, self.frozen = Seen(listeners=1, commanders=1), set()
        while controller.servo.stamp < 0:  # the first image
            self._pass()

    def carry_out(self, skill: Skill, seconds: float, after: Callable[[Moment], None] = lambda _: None) -> Ended | None:
        """How the motion ended; None if it has not, after so many seconds. after: called at the end of each period."""
        self._controller.begin(skill)
        until = self.now + seconds
        while self.now < until:
            image = self._pass()
            twist, ended = self._controller.step(self.now, self.seen)
            self._arm.command(self.now, twist)
            after(Moment(self.now, twist, self._where(), image))
            if ended is not None:
                return ended
        return None

    def _pass(self) -> bool:
        """One period; whether an image was taken in it."""
        self.now += PERIOD
        pose = self._arm.advance(self.now)
        taken = self.now >= self._due
        if taken:
            self._due += 1 / self._fps
            self._coming.append((self.now + self._delay(), Measured(self.now, *self._look(self._where()))))
        while self._coming and self._coming[0][0] <= self.now:
            self._controller.servo.measure(self.now, self._coming.popleft()[1])
        news = {"enabled": self.now, "image": self._controller.servo.stamp, "pose": self.now, "gel": pose}
        for name in news.keys() - self.frozen:
            setattr(self.seen, name, news[name])
        return taken
