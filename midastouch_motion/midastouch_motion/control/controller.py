"""Controller of one motion at a time, as long as the guard allows it; the node calls it at each control period."""

from __future__ import annotations

import numpy as np

from midastouch_common import se3

from .contact_servo import LONGEST_PERIOD, ContactServo
from .guard import Guard, Seen
from .skills import BackOffSkill, Skill, SkillEnd

_COMES_WITHIN = 1.0  # s: longest wait for the first image or an `enable`
_STILL = 1e-3, np.radians(1.0)  # m, rad: an arm that moves no further than this stays where it is
_FOLLOWS_WITHIN = 1e-2, np.radians(10.0)  # m, rad of twists; latency, and a gel that gives way, account for less


class Controller:
    """Controller of an arm. Args: servo; guard.

    Attributes: servo; guard; skill that is carried out, None while nothing is.
    """

    def __init__(self, servo: ContactServo, guard: Guard):
        self.servo, self.guard = servo, guard
        self.skill: Skill | None = None
        self._reason: SkillEnd | None = None  # result of a motion that is over, while the gel backs off
        self._since: float | None = None  # s, when the present motion was first asked for a twist
        self._moving = False
        self._free = False  # whether a gel that leaves a surface has been free of too strong a force
        self._following = _Following()

    @property
    def path(self) -> float:
        """Path of the present motion [m]."""
        return self.skill.path if self.skill is not None else 0.0

    def begin(self, skill: Skill) -> None:
        """Begin to carry out a skill."""
        self.skill, self._reason = skill, None
        self._since, self._moving, self._free = None, False, False
        self._following = _Following()

    def step(self, now: float, seen: Seen) -> tuple[np.ndarray, SkillEnd | None]:
        """Return the twist (6,) at `now` [s], and the result of the motion once it has ended: then the twist is zero.

        `seen.depth` is replaced by the servo's prediction. A gel that is too deep stops at once, backs off, and only
        then ends the motion. A motion that has not begun yet waits up to a second for what it needs.
        """
        seen.depth = self.servo.depth
        if self._since is None:
            self._since = now
            return self.servo.stop(now), None  # the motion accelerates from zero
        problem = self.guard.stop(now, seen)
        if not (problem or self.skill.leaves) and (problem := self.guard.too_deep(seen)):
            self._reason, self.skill = SkillEnd(False, problem), BackOffSkill()
            return self.servo.stop(now), None
        if problem := problem or self._too_strong(seen):
            if not self._moving and now - self._since < _COMES_WITHIN:
                return self.servo.stop(now), None
            return self._end(now, self._reason or SkillEnd(False, problem))
        answer = self.skill.step(self.servo, now, seen.gel)
        if isinstance(answer, SkillEnd):
            # a motion off the surface is right beyond the cone, too
            outside = self.guard.outside_box if self.skill.leaves else self.guard.outside
            if answer.success and (problem := outside(seen)):
                answer = SkillEnd(False, problem)
            return self._end(now, self._reason or answer)
        self._moving = True
        twist = self.servo.command(now, answer) if answer.any() else self.servo.stop(now)
        if problem := self.guard.outside(seen, twist) or self._following.problem(now, twist, seen):
            return self._end(now, self._reason or SkillEnd(False, problem))
        return twist, None

    def _too_strong(self, seen: Seen) -> str:
        """Return the guard's `too_strong`; but a gel that leaves the surface may exceed the force until it is free."""
        problem = self.guard.too_strong(seen)
        self._free = self.skill.leaves and (self._free or not problem)
        return "" if self.skill.leaves and not self._free else problem

    def cancel(self, now: float) -> np.ndarray:
        """Stop at once and return the twist for it, zero."""
        return self._end(now, SkillEnd(False, "cancelled"))[0]

    def _end(self, now: float, how: SkillEnd) -> tuple[np.ndarray, SkillEnd]:
        self.skill, self._reason = None, None
        return self.servo.stop(now), how


class _Following:
    """Check that an arm follows its twists: one that is held up must not be pushed on for ever."""

    def __init__(self) -> None:
        self._from: np.ndarray | None = None
        self._asked, self._then, self._newest = np.zeros(6), 0.0, -np.inf

    def problem(self, now: float, twist: np.ndarray, seen: Seen) -> str:
        """Return why the arm does not follow, empty as long as it does. twist (6,): from `now` [s] on."""
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
    """Return the lengths of the linear and the angular part of a twist (6,)."""
    return np.linalg.norm(twist.reshape(2, 3), axis=1)
