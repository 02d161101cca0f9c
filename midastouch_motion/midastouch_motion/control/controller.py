"""Controller of one motion at a time, as long as the guard allows it; the node calls it at each control period."""

from __future__ import annotations

import numpy as np

from midastouch_common import se3
from midastouch_perception.sensor_model import MAX_PENETRATION

from .contact_servo import LONGEST_PERIOD, ContactServo, Limits
from .guard import Guard, Seen
from .skills import BackOffSkill, Skill, SkillEnd
from .wrench import ForceModel, Wrench

_COMES_WITHIN = 1.0  # s: longest wait at rest for what a motion needs
_STILL = 1e-3, np.radians(1.0)  # m, rad: an arm that moves no further than this stays where it is
_JUMP = 2e-3, np.radians(3.0)  # m, rad: noise of the arm's poses, and ways beyond the limits, are smaller
_FOLLOWS_WITHIN = 1e-2, np.radians(10.0)  # m, rad of twists; latency, and a gel that gives way, account for less


class Controller:
    """Controller of an arm.

    Attributes: servo; guard; wrench; skill that is carried out, None while nothing is.

    Parameters
    ----------
    servo
        Holds depth and tilt in contact.
    guard
        Gives the reasons to stop.
    forces
        What the arm's forces mean, if samples of them come.
    """

    def __init__(self, servo: ContactServo, guard: Guard, forces: ForceModel | None = None):
        self.servo, self.guard, self.wrench = servo, guard, Wrench(forces or ForceModel())
        self.skill: Skill | None = None
        self._reason: SkillEnd | None = None  # result of a motion that is over, while the gel backs off
        self._since: float | None = None  # s, when the present motion last moved; before that, when it began
        self._moving = False
        self._clear = True  # whether the last motion has led off whatever touched
        self._held: float | None = None  # s, since when it stands still for a force that an image may explain
        self._free = False  # whether a gel that leaves a surface has been free of too strong a force
        self._following = _Following()

    @property
    def path(self) -> float:
        """Path of the present motion [m]."""
        return self.skill.path if self.skill is not None else 0.0

    def begin(self, skill: Skill) -> None:
        """Begin to carry out a skill."""
        self.skill, self._reason = skill, None
        self._since, self._moving, self._free, self._held = None, False, False, None
        self._following = _Following()

    def step(self, now: float, seen: Seen) -> tuple[np.ndarray, SkillEnd | None]:
        """Carry out one control period.

        `seen.depth` is replaced by the servo's prediction. A gel that is too deep, or meets something with its rim,
        stops at once, backs off, and only then ends the motion. A motion that lacks something stops at once, too, and
        goes on if it comes within a second; one that has not begun yet waits so long for all that it needs.

        Parameters
        ----------
        now : [s]
        seen
            Newest inputs of the guard.

        Returns
        -------
        twist : (6,) of the gel [m/s, rad/s]
            Zero once the motion has ended.
        end : SkillEnd or None
            Result of the motion once it has ended.
        """
        seen.depth = self.servo.depth
        free = self._clear and not (self._moving or self.servo.touching or seen.unread)
        untared = self.wrench.tare() if free else ""
        if self._since is None:
            self._since = now
            return self.servo.begin(now), None  # the motion accelerates from zero
        self.servo.pass_by(now, seen.gel)
        stop, late = self.guard.stop(now, seen), self.guard.late(now, seen)
        jump = self._following.jump(seen, self.servo.limits)
        problem = stop or late or untared or ("" if self.skill.leaves else jump)
        if not (problem or self.skill.leaves) and (self._must_go_back(now, seen) or self._held is not None):
            return self.servo.stop(now), None
        if problem := problem or self._too_strong(seen):
            if (not self._moving or (late and not stop)) and now - self._since < _COMES_WITHIN:
                return self.servo.stop(now), None
            return self._end(now, self._reason or SkillEnd(False, problem))
        answer = self.skill.step(self.servo, now, seen.gel)
        if isinstance(answer, SkillEnd):
            # a motion off the surface is right beyond the cone, too
            outside = self.guard.outside_box if self.skill.leaves else self.guard.outside
            if answer.success and (problem := outside(seen)):
                answer = SkillEnd(False, problem)
            return self._end(now, self._reason or answer)
        self._moving, self._since = True, now
        twist = self.servo.command(now, answer) if answer.any() else self.servo.stop(now)
        if problem := self.guard.outside(seen, twist):
            return self._end(now, self._reason or SkillEnd(False, problem))
        if problem := self._following.problem(now, twist, seen):
            if self.skill.leaves:
                return self._end(now, self._reason or SkillEnd(False, problem))
            self._go_back(problem, BackOffSkill(clear=True))
            return self.servo.stop(now), None
        return twist, None

    def _must_go_back(self, now: float, seen: Seen) -> bool:
        """Return whether the gel must be pulled back; if so, begin that, after which the motion ends for the reason."""
        against = "its depth falls although it is pressed on: deeper than images show" if self.servo.fallen else ""
        if self.servo.risen:
            against = "its depth grows although it is pulled off: a wall leans over it"
        if problem := self.guard.too_deep(seen):
            back = BackOffSkill()
        elif problem := seen.unread or against or self._unexplained(now):
            back = BackOffSkill(clear=True, least=MAX_PENETRATION)
        else:
            return False
        self._go_back(problem, back)
        return True

    def _go_back(self, problem: str, back: BackOffSkill) -> None:
        """Begin to pull the gel back, after which the motion ends for a reason."""
        self._reason, self.skill, self._following = SkillEnd(False, problem), back, _Following()

    def _unexplained(self, now: float) -> str:
        """Return why the gel must be pulled back for the force on it; empty if it need not be.

        After a force that an image may still explain, the arm stands still (`held`) until an image was taken since.
        """
        mismatch = self.wrench.compared(self.servo.displaced, float(np.linalg.norm(self.servo.slope)))
        if self._held is None and mismatch.problem:
            self._held = now
        if self._held is not None and self.servo.stamp > self._held + self.servo.arm_latency:
            self._held = None
            return mismatch.problem
        return mismatch.problem if mismatch.sure else ""

    def _too_strong(self, seen: Seen) -> str:
        """Return the guard's `too_strong`; but a gel that leaves the surface may exceed the force until it is free."""
        problem = self.guard.too_strong(seen)
        self._free = self.skill.leaves and (self._free or not problem)
        return "" if self.skill.leaves and not self._free else problem

    def cancel(self, now: float) -> np.ndarray:
        """Stop at once and return the twist for it, zero."""
        return self._end(now, SkillEnd(False, "cancelled"))[0]

    def _end(self, now: float, how: SkillEnd) -> tuple[np.ndarray, SkillEnd]:
        if self._moving:
            self._clear = self.skill.leaves or (how.success and not self.servo.touching)
        self.skill, self._reason = None, None
        return self.servo.stop(now), how


class _Following:
    """Check that an arm follows its twists: one that is held up must not be pushed on for ever, and none jumps."""

    def __init__(self) -> None:
        self._before: tuple[float, np.ndarray] | None = None  # stamp [s] and pose (4, 4) of the gel a period ago
        self._from: np.ndarray | None = None
        self._asked, self._then, self._newest = np.zeros(6), 0.0, -np.inf

    def jump(self, seen: Seen, limits: Limits) -> str:
        """Return that the gel's pose has changed by more than the limits of its motion allow; empty if it has not."""
        before, self._before = self._before, (seen.pose, seen.gel.copy())
        if before is None:
            return ""
        most = _JUMP + 1.5 * max(seen.pose - before[0], 0.0) * np.array([limits.air_speed, limits.turn_speed])
        way, angle = moved = _moved(before[1], seen.gel)
        if (moved <= most).all():
            return ""
        jump = f"the gel's transform jumped by {1e3 * way:.1f} mm and {np.degrees(angle):.0f} deg"
        return f"{jump}: was its mount changed, or does anything else move the arm?"

    def problem(self, now: float, twist: np.ndarray, seen: Seen) -> str:
        """Return why the arm does not follow, empty as long as it does. twist (6,): from `now` [s] on."""
        if self._from is None or (_moved(self._from, seen.gel) > _STILL).any():
            self._from, self._asked = seen.gel.copy(), np.zeros(6)
        else:
            self._asked += min(now - self._then, LONGEST_PERIOD) * twist
        news, self._then, self._newest = seen.pose > self._newest, now, seen.pose
        asked = _lengths(self._asked)
        if not news or (asked < _FOLLOWS_WITHIN).all():
            return ""
        way, angle = 1e3 * asked[0], np.degrees(asked[1])
        return f"the arm does not follow: it stays where it is over {way:.0f} mm and {angle:.0f} deg of twists"


def _moved(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Return the way [m] and the angle [rad] (2,) from a pose (4, 4) to another."""
    return _lengths(se3.log(se3.inverse(before) @ after))


def _lengths(twist: np.ndarray) -> np.ndarray:
    """Return the lengths of the linear and the angular part of a twist (6,)."""
    return np.linalg.norm(twist.reshape(2, 3), axis=1)
