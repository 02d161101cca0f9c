"""Motions: touch until a depth is reached, slide, lift, approach a pose, back off from too deep a contact.

Each returns the twist of the moment, or its result once it has ended.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from midastouch_common import se3

from .contact_servo import RIM, ContactServo

_SETTLED, _SETTLED_FOR = 1e-4, 0.2  # m, s: a touch is done once it has stayed this near to the wanted depth this long
_TURN, _SETTLES = np.pi / 2, 3.0  # rad, s: a touch has the time of this turn, and this time more, to settle
_NO_FARTHER_FOR = 3.0  # s without progress, after which a slide fails; the gel may turn about an edge meanwhile
_STEP = 5e-4  # m
_STALLED_FOR = 0.3  # s without progress in which a gel turns with the surface; in more it would turn about an edge
_REACH = 1e-3  # m: a lost contact is looked for down to this far below the wanted depth
_THICK = 5e-3  # m, thickness of a gel
_RISEN = 0.5  # part of a way along the gel's axis, from which a gel that rises meets something beside or above it
_THERE = 1e-3, np.radians(1.0)  # m, rad: a gel this near to a pose has arrived


class SkillEnd(NamedTuple):
    """Result of a motion: whether it did what was asked, and a message on how it ended."""

    success: bool
    message: str


_BACKED_OFF = SkillEnd(True, "backed off")


class Skill(Protocol):
    """A motion. Attributes: path [m] so far; leaves, whether it leads straight off the surface."""

    path: float

    @property
    def leaves(self) -> bool: ...

    def step(self, servo: ContactServo, now: float, pose: np.ndarray) -> np.ndarray | SkillEnd:
        """Carry out one control period.

        Parameters
        ----------
        servo
        now : [s]
        pose : (4, 4), of the gel in the base frame

        Returns
        -------
        (6,) twist of the gel, or the motion's result
        """


class _Moving:
    """Base of motions that count their path, in steps that are larger than the noise of an arm's poses."""

    leaves = False

    def __init__(self) -> None:
        self.path = 0.0
        self._at: np.ndarray | None = None

    def _gone(self, pose: np.ndarray) -> float:
        position = pose[:3, 3]
        self._at = position.copy() if self._at is None else self._at
        step = float(np.linalg.norm(position - self._at))
        if step > _STEP:
            self.path += step
            self._at = position.copy()
        return self.path


class TouchSkill(_Moving):
    """Motion along a direction until something touches.

    The gel then moves over the contact until all of it is seen, and holds a depth. An object that gives way is followed
    no further than a gel is thick, and not for ever.

    Parameters
    ----------
    depth : [m]
    distance : most way until something touches [m]
    direction : (3,) in the gel's frame
        The -z axis if None.
    """

    def __init__(self, depth: float, distance: float, direction: np.ndarray | None = None):
        super().__init__()
        self._depth, self._distance = depth, distance
        self._direction = np.array([0.0, 0.0, -1.0]) if direction is None else direction / np.linalg.norm(direction)
        self._touched: float | None = None  # s, when it touched first
        self._at_contact = 0.0  # m gone when it touched last
        self._settled: float | None = None  # s, since when it has held that depth

    def step(self, servo: ContactServo, now: float, pose: np.ndarray) -> np.ndarray | SkillEnd:
        gone = self._gone(pose)
        if servo.touching and gone > self._distance + _THICK:
            return SkillEnd(False, f"what touches gives way: {1e3 * servo.depth:.2f} mm deep after {1e3 * gone:.0f} mm")
        if servo.touching:
            self._touched = now if self._touched is None else self._touched
            self._at_contact = gone
        elif gone > self._at_contact + self._depth + _REACH:  # the surface is further on: it touched something else
            self._touched = None
        # a contact that comes and goes has not settled either
        if self._touched is not None and now - self._touched > _TURN / servo.limits.turn_speed + _SETTLES:
            return SkillEnd(
                False, f"the depth does not settle: {1e3 * servo.depth:.2f} mm, not {1e3 * self._depth:.2f}"
            )
        if not servo.touching:
            self._settled = None
            if gone > self._distance:
                return SkillEnd(False, f"nothing touched within {1e3 * self._distance:.0f} mm")
            return np.concatenate([servo.approach_speed(self._depth) * self._direction, np.zeros(3)])
        if abs(servo.depth - self._depth) > _SETTLED or servo.off_centre.any():
            self._settled = None
        elif self._settled is None:
            self._settled = now
        elif now - self._settled > _SETTLED_FOR:
            return SkillEnd(True, f"touches, {1e3 * servo.depth:.2f} mm deep")
        return servo.pressed(self._depth, servo.back(self._depth))


class SlideSkill:
    """Motion along a surface in a direction that keeps its heading in the gel's plane.

    If the contact falls behind, the gel waits until it has turned; if that does not help, the surface has ended. A
    contact that is lost is looked for straight below.

    Parameters
    ----------
    heading : [rad] in the gel's plane
    length, depth : [m]
    """

    leaves = False

    def __init__(self, heading: float, length: float, depth: float):
        self.path = 0.0
        self._along = np.array([np.cos(heading), np.sin(heading)])
        self._length, self._depth = length, depth
        self._touched = False
        self._lost: np.ndarray | None = None
        self._before: np.ndarray | None = None  # (3,) m
        self._on = 0.0  # m along the heading: hops on and off the surface do not count
        self._since = 0.0  # s, time of the last progress

    def step(self, servo: ContactServo, now: float, pose: np.ndarray) -> np.ndarray | SkillEnd:
        if self._before is None:
            self._since = now
        else:
            self._on += float(self._along @ (pose[:3, :2].T @ (pose[:3, 3] - self._before)))
        self._before = pose[:3, 3].copy()
        if self._on >= min(self.path + _STEP, self._length):
            self.path, self._since = self._on, now
        on = f"{1e3 * self.path:.0f} mm"
        if self.path >= self._length:
            return SkillEnd(True, f"slid {on}")
        if now - self._since > _NO_FARTHER_FOR:
            return SkillEnd(False, f"it gets no further than {on}; {1e3 * servo.depth:.2f} mm deep")
        if servo.touching:
            self._touched, self._lost = True, None
            if now - self._since > _STALLED_FOR and servo.off_centre @ self._along < 0:
                return SkillEnd(False, f"the contact leaves the gel after {on}: over an edge")
            return servo.pressed(self._depth, servo.slide_speed(self._depth) * self._along + servo.back(self._depth))
        if self._lost is None:
            if not self._touched:
                return SkillEnd(False, "nothing touches: touch first")
            self._lost = pose[:3, 3].copy()
        if np.linalg.norm(pose[:3, 3] - self._lost) > self._depth + _REACH:
            return SkillEnd(False, f"the contact was lost after {on}: over an edge, or off the object")
        return np.array([0, 0, -servo.approach_speed(self._depth), 0, 0, 0.0])


class BackOffSkill(_Moving):
    """Motion back on the way that the gel has come, which is free, and off a surface on which it stays, until the depth
    is half of its limit; beyond that way straight off, and at most as far as a gel is thick in all.

    Parameters
    ----------
    clear
        True to go on until nothing touches.
    least : [m]
        Way that is gone in any case, for a gel whose depth is not known.
    end
        Its result.
    """

    leaves = True

    def __init__(self, clear: bool = False, least: float = 0.0, end: SkillEnd = _BACKED_OFF):
        super().__init__()
        self._clear, self._least, self._end = clear, least, end
        self._trail: list[np.ndarray] | None = None
        self._stays, self._then, self._on = False, 0.0, 0.0  # s; m from the trail's last pose on

    def step(self, servo: ContactServo, now: float, pose: np.ndarray) -> np.ndarray | SkillEnd:
        if self._trail is None:
            self._trail, self._stays, self._then = servo.trail, servo.stays and not servo.risen, now
        off = not servo.touching if self._clear else servo.depth < 0.5 * servo.limits.depth
        gone = self._gone(pose)
        if (off and gone >= self._least) or gone > _THICK:
            return self._end
        self._on, self._then = self._on + servo.limits.speed * (now - self._then), now
        while len(self._trail) > 1:
            way = se3.log(se3.inverse(self._trail[-1]) @ self._trail[-2])
            length = float(np.linalg.norm(way[:3])) + RIM * float(np.linalg.norm(way[3:]))
            if self._on < length:
                way /= length
                if self._stays and way[2] > -_RISEN:
                    way[2] += 1.0
                    way[:3] /= np.linalg.norm(way[:3])
                return servo.limits.speed * way
            self._on -= length
            self._trail.pop()
        return np.concatenate([servo.limits.speed * servo.off, np.zeros(3)])


def _met_on_the_way(gone: float) -> BackOffSkill:
    """Return the motion back from what a motion has met after `gone` [m], which then fails."""
    return BackOffSkill(clear=True, end=SkillEnd(False, f"touched on the way after {1e3 * gone:.0f} mm"))


class LiftSkill(_Moving):
    """Motion straight off the surface, by a height [m], until something else touches; then the gel backs off."""

    leaves = True

    def __init__(self, height: float):
        super().__init__()
        self._height = height
        self._back: BackOffSkill | None = None

    def step(self, servo: ContactServo, now: float, pose: np.ndarray) -> np.ndarray | SkillEnd:
        gone = self._gone(pose)
        if self._back is None and (servo.met or servo.risen):
            self._back = _met_on_the_way(gone)
            return np.zeros(6)
        if self._back is not None:
            return self._back.step(servo, now, pose)
        if gone >= self._height:
            return SkillEnd(True, f"lifted by {1e3 * self._height:.0f} mm")
        return np.array([0, 0, servo.flight_speed, 0, 0, 0.0])


class ApproachSkill(_Moving):
    """Motion through the air to a pose (4, 4) in the base frame, straight and turning, both done at once.

    The gel first leaves the surface. A contact on the way ends the motion, after the gel has backed off.
    """

    def __init__(self, goal: np.ndarray):
        super().__init__()
        self._goal = goal
        self._back: BackOffSkill | None = BackOffSkill(clear=True)

    @property
    def leaves(self) -> bool:  # type: ignore[override] # nobody sets it
        return self._back is not None

    def step(self, servo: ContactServo, now: float, pose: np.ndarray) -> np.ndarray | SkillEnd:
        gone = self._gone(pose)
        if self._back is None and servo.touching:
            self._back = _met_on_the_way(gone)
            return np.zeros(6)
        if self._back is not None:
            answer = self._back.step(servo, now, pose)
            if not isinstance(answer, SkillEnd) or not answer.success:
                return answer
            self._back = None
        way = pose[:3, :3].T @ (self._goal[:3, 3] - pose[:3, 3])
        turn = se3.log(se3.inverse(pose) @ self._goal)[3:]
        far, angle = float(np.linalg.norm(way)), float(np.linalg.norm(turn))
        if far < _THERE[0] and angle < _THERE[1]:
            return SkillEnd(True, f"there, after {1e3 * gone:.0f} mm")
        # slower at the end, because the known pose of the gel is old, too
        seconds = max((far + RIM * angle) / servo.flight_speed, angle / servo.limits.turn_speed, 1.0 / servo.gain)
        return np.concatenate([way, turn]) / seconds
