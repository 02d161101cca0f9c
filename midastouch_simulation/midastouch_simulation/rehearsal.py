"""Rehearsal of motions in simulated time: an arm, the late images of its sensor and the controller form a loop."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from typing import Generic, NamedTuple, Protocol, TypeVar

import numpy as np

from midastouch_motion.control.controller import Controller
from midastouch_motion.control.guard import Seen
from midastouch_motion.control.measured import Measured
from midastouch_motion.control.skills import Skill, SkillEnd
from midastouch_motion.control.wrench import Sample

PERIOD = 0.01
"""Time between two twists [s], as in the node `contact_controller`."""

_T = TypeVar("_T")


class Late(Generic[_T]):
    """Queue of items under way, which arrive in the order in which they were sent."""

    def __init__(self) -> None:
        self._coming: deque[tuple[float, _T]] = deque()

    def send(self, arrival: float, what: _T) -> None:
        """Send an item that arrives at a time [s]."""
        self._coming.append((arrival, what))

    def arrived(self, now: float) -> Iterator[tuple[float, _T]]:
        """Yield each item that has arrived by `now` [s], once, with its time of arrival."""
        while self._coming and self._coming[0][0] <= now:
            yield self._coming.popleft()


class Arm(Protocol):
    """Arm that follows twists (6,) in the gel's frame; `advance` returns its pose T_base_gel (4, 4) at a time [s]."""

    def command(self, now: float, twist: np.ndarray) -> None: ...

    def advance(self, now: float) -> np.ndarray: ...


class PeriodState(NamedTuple):
    """State after a period: time [s]; twist (6,) that was commanded; where, the gel's T_obj_gel (4, 4); image, whether
    one was taken."""

    time: float
    twist: np.ndarray
    where: np.ndarray
    image: bool


class Rehearsal:
    """Rehearsal of one motion after the other.

    Args: arm; where(): returns T_obj_gel (4, 4) of its gel; look(T_obj_gel): returns the contact in an image there, of
    any stamp; controller; fps, images per second; delay(): returns the seconds until an image is understood;
    measure_force(): returns the force (3,) [N] on the gel in its frame, None for an arm without a sensor of it.
    Attributes: controller, with its guard; now [s]; seen, the guard's input; frozen, names among `enabled`, `image`,
    `pose`, `wrench`, `force` and `gel` of inputs that are not updated; delay; jump (4, 4), by which the poses of TF are
    off. Set them to inject a fault; `restore` undoes that.
    """

    def __init__(
        self,
        arm: Arm,
        where: Callable[[], np.ndarray],
        look: Callable[[np.ndarray], Measured],
        controller: Controller,
        fps: float,
        delay: Callable[[], float],
        measure_force: Callable[[], np.ndarray] | None = None,
    ):
        self._arm, self._where, self._look, self.controller = arm, where, look, controller
        self._fps, self._measure_force = fps, measure_force
        self._usual = controller.guard, delay
        self._images: Late[Measured] = Late()
        self._due = self.now = 0.0
        self.frozen: set[str] = set()
        self.restore()
        while controller.servo.stamp < 0:  # the first image
            self._pass()

    def restore(self) -> None:
        """Undo all faults."""
        self.controller.guard, self.delay = self._usual
        self.seen, self.jump = Seen(listeners=1, commanders=1), np.eye(4)
        self.frozen.clear()

    def carry_out(
        self, skill: Skill, seconds: float, after: Callable[[PeriodState], None] = lambda _: None
    ) -> SkillEnd | None:
        """Carry out a motion and return its result, None after `seconds` without one. after: called each period."""
        self.controller.begin(skill)
        until = self.now + seconds
        while self.now < until:
            image = self._pass()
            twist, ended = self.controller.step(self.now, self.seen)
            self._arm.command(self.now, twist)
            after(PeriodState(self.now, twist, self._where(), image))
            if ended is not None:
                return ended
        return None

    def _pass(self) -> bool:
        """Simulate one period; return whether an image was taken in it."""
        self.now += PERIOD
        pose = self.jump @ self._arm.advance(self.now)
        taken = self.now >= self._due
        if taken:
            self._due += 1 / self._fps
            self._images.send(self.now + self.delay(), self._look(self._where())._replace(stamp=self.now))
        for _, measured in self._images.arrived(self.now):
            self.controller.servo.measure(self.now, measured)
        news = {
            "enabled": self.now,
            "image": self.controller.servo.stamp,
            "pose": self.now,
            "wrench": self.now,
            "gel": pose,
        }
        wrench = self.controller.wrench
        if self._measure_force is not None and "wrench" not in self.frozen:
            wrench.take(Sample(self.now, self._measure_force(), pose[2, :3]))
            news["force"] = float(np.linalg.norm(wrench.force))
        for name in news.keys() - self.frozen:
            setattr(self.seen, name, news[name])
        return taken
