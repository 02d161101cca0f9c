"""One motion at a time, as long as the guard lets it: what the node does at each control period."""

from __future__ import annotations

import numpy as np

from midastouch_common import se3

from .contact_servo import LONGEST_PERIOD, ContactServo
from .guard import Guard, Seen
from .skills import BackOff, Ended, Skill

_COMES_WITHIN = 1.0  # s: the first image, an `enable`
_STILL = 1e-3, np.radians(1.0)  # m, rad: an arm that goes no farther stays where it is
_FOLLOWS_WITHIN = 1e-2, np.radians(10.0)  # m, rad of twists; latency, and gel that gives way, cost less


class Controller:
    """Args: servo; guard.

    Attributes: servo; guard; skill, that is carried out, None while nothing is.
    """

    def __init__(self, servo: ContactServo, guard: Guard):
        self.servo, self.guard = servo, guard
        self.skill: Skill | None = None
        self._reason: Ended | None = None  # of a motion that is over, while the gel backs off
        self._since: float | None = None  # s, when the present motion was first asked for a twist
        self._moving = False
        self._free = False  # whether a gel that is led off a surface has got free of what presses on it
        self._following = _Following()

    @property
    def path(self) -> float:
        """m gone in the present motion."""
        return self.skill.path if self.skill is not None else 0.0

    def begin(self, skill: Skill) -> None:
        """Carry out a skill from now on."""
        self.skill, self._reason = skill, None
        self._since, self._moving, self._free = None, False, False
        self._following = _Following()

    def step(self, now: float, seen: Seen) -> tuple[np.ndarray, Ended | None]:
        """The twist (6,) at `now` [s], and how the motion has ended if it has: then the twist is zero.

        seen: but for its depth, which is the servo's. What is too deep stops at once and is pulled back before the
        motion ends. One that has not begun yet waits a little for what it needs.
        """
        seen.depth = self.servo.depth
        if self._since is None:
            self._since = now
            return self.servo.stop(now), None  # from which it gets faster
        problem = self.guard.stop(now, seen)
        if not (problem or self.skill.leaves) and (problem := self.guard.too_deep(seen)):
            self._reason, self.skill = Ended(False, problem), BackOff()
            return self.servo.stop(now), None
        if problem := problem or self._too_strong(seen):
            if not self._moving and now - self._since < _COMES_WITHIN:
                return self.servo.stop(now), None
            return self._end(now, self._reason or Ended(False, problem))
        answer = self.skill.step(self.servo, now, seen.gel)
        if isinstance(answer, Ended):
            # off the surface is right beyond the cone, too
            outside = self.guard.outside_box if self.skill.leaves else self.guard.outside
            if answer.success and (problem := outside(seen)):
                answer = Ended(False, problem)
            return self._end(now, self._reason or answer)
        self._moving = True
        twist = self.servo.command(now, answer) if answer.any() else self.servo.stop(now)
        if problem := self.guard.outside(seen, twist) or self._following.problem(now, twist, seen):
            return self._end(now, self._reason or Ended(False, problem))
        return twist, None

    def _too_strong(self, seen: Seen) -> str:
        """As of the guard; but what presses on a gel that is led off the surface may do so until it is free."""
        problem = self.guard.too_strong(seen)
        self._free = self.skill.leaves and (self._free or not problem)
        return "" if self.skill.leaves and not self._free else problem

    def cancel(self, now: float) -> np.ndarray:
        """Stop at once; the twist of that, zero."""
        return self._end(now, Ended(False, "cancelled"))[0]

    def _end(self, now: float, how: Ended) -> tuple[np.ndarray, Ended]:
        self.skill, self._reason = None, None
        return self.servo.stop(now), how


class _Following:
    """Whether an arm goes where the twists would have it go: one that is held up must not be pushed on for ever."""

    def __init__(self) -> None:
        self._from: np.ndarray | None = None
        self._asked, self._then, self._newest = np.zeros(6), 0.0, -np.inf

    def problem(self, now: float, twist: np.ndarray, seen: Seen) -> str:
        """Why not, in words; empty as long as it does. twist (6,) from `now` [s] on; seen: where the gel is."""
        if self._from is None or (_lengths(se3.log(se3.inverse(self._from) @ seen.gel)) > _STILL).any():
            self._from, self._asked = seen.gel.copy(), np.zeros(6)
        else:
            self._asked += min(now - self._then, LONGEST_PERIOD) * twist
        news, self._then, self._newest = seen.pose > self._newest, now, seen.pose
        asked = _lengths(self._asked)
        if not news or (asked < _FOLLOWS_WITHIN).all():
            return ""
        way, angle = 1e3 * asked[0], np.degrees(asked[1])
        return f"the arm does not follow: it stays where it is over {way:.0f} mm and {angle:.0f} deg of twists"


def _lengths(twist: np.ndarray) -> np.ndarray:
    """Of the linear and the angular part of a twist (6,)."""
    return np.linalg.norm(twist.reshape(2, 3), axis=1)
