"""Slides and leaps of an arm within its reach, as plans of acts, and a record of their ends."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from midastouch_common import se3
from midastouch_common.surface_walk import MIN_PROGRESS

from .acts import Act, Approach, CheckReach, Done, Lift, Plan, Slide, Touch, carried_out
from .leap import CLEARANCES, SEARCHED, leap, ways_along, ways_to
from .reach import Reach
from .surroundings import SurfaceTrack, Surroundings

_BLOCKED = 0.5  # of its length: a slide that ends earlier has met an obstacle
_SHOWN = 2e-3  # m: a slide that is stopped earlier has shown nothing new
_NEAR = 1e-3  # m from a position that a person shows that count as there
_BESIDE = 0.013  # m, the width of a gel: places further apart are distinct
_SLIDES_TO = 4  # slides to a position, each along the chord of the path that is left


@dataclass(frozen=True)
class Motion:
    """A slide, or with `lift` a leap, in direction `heading` [rad] of the gel's plane, over `length` [m]."""

    heading: float
    length: float
    lift: bool = False


class Motions:
    """Motions, carried out one after the other.

    Attributes: path [m]: on the surface; slides, lifts: their numbers; touching, gel T_base_gel (4, 4): after the
    newest act; blocked: True if an obstacle stopped the last slide; why_not: reason of the last failed act, in words.
    Args: reach: motions that leave it are not made; down [m]: depth to which it searches for an unknown surface;
    held(): True while it must not begin a further motion by itself.
    """

    def __init__(self, reach: Reach, down: float, held: Callable[[], bool]):
        self._reach, self._down, self._held = reach, down, held
        self.path, self.slides, self.lifts = 0.0, 0, 0
        self.touching = self.blocked = False
        self.why_not, self.gel = "", np.eye(4)
        self._places: list[np.ndarray] = []  # T_base_gel where it has touched within the arm's reach

    def touch(self) -> Plan[Done]:
        """Go down until something touches, and up again if nothing does."""
        done = yield from self._do(Touch(self._down))
        self.lifts += done.touching
        if not done.touching:
            yield from self._do(Lift(max(done.path, CLEARANCES[0])))
        return done

    def reachable(self, motion: Motion, around: Surroundings) -> bool:
        """Return whether the way is within the box and cone of `reach`; `CheckReach` is not asked here."""
        if motion.lift:
            return self._can_leap(ways_along(around, motion.heading, motion.length)[0])
        return self._reach.holds(_way(motion, around))

    def carry_out(self, motion: Motion, around: Surroundings, others: bool = True) -> Plan[bool]:
        """Carry out this motion as far as possible; return whether it led to anything new. others: True if a leap that
        cannot touch at its end tries positions near it."""
        if not motion.lift:
            return (yield from self._slide(motion, around))
        ways = ways_along(around, motion.heading, motion.length)
        return (yield from self._leap(ways if others else ways[:1], around))

    def visit(self, position: np.ndarray, around: Surroundings) -> Plan[bool]:
        """Touch the surface next to a position (3,) m of the base frame: slide there if possible, otherwise lift.

        Return whether it touches there, not only as near as it can.
        """
        goal = around.over(position)[:3, 3]
        for _ in range(_SLIDES_TO):
            track = around.towards(goal, _distance(around, goal))
            if _distance(around, goal) < _NEAR or not _comes_nearer(track, goal):
                break
            went = yield from self._slide(Motion(track.heading, track.gone[-1]), around)
            around = replace(around, gel=self.gel)
            if not went:
                break
        if _distance(around, goal) > _NEAR or not self.touching:
            yield from self._leap(ways_to(around, goal), around)
            around = replace(around, gel=self.gel)
        self.blocked = False
        return self.touching and _distance(around, goal) < _NEAR

    def back(self) -> Plan[bool]:
        """Go back to the last place that it has touched, or to one before; return whether it touches there within
        reach. If that fails, the places near it are forgotten, except the first of all."""
        for place in [*reversed(self._places)]:  # a copy: touches on the way are added
            if self._held():
                return False
            if not any(place is kept for kept in self._places):
                continue
            before = self.gel
            came = yield from self._leap([place[None]], Surroundings(before), SEARCHED)
            if self.gel is before and not came:  # it cannot lift off along its axis here
                came = yield from self._straight_to(place)
            if came and self._reach.holds(self.gel[None]):
                return True
            later = (each for each in self._places[1:] if np.linalg.norm((each - place)[:3, 3]) > _BESIDE)
            self._places = [*self._places[:1], *later]
        return False

    def _slide(self, motion: Motion, around: Surroundings) -> Plan[bool]:
        if not self.touching:
            return False
        if self._reach.asks:
            way = _way(motion, around)  # the gel is at its first pose
            if not (yield from self._said_to_be_reached(np.concatenate([way[1:], _raised(way[-1:])]))):
                return False
        done = yield from self._do(Slide(motion.heading, motion.length))
        self.path += done.path
        self.slides += done.path > 0
        if not (done.touching and self._reach.holds(done.pose[None])):  # past an edge, or out of reach
            yield from self._leap([around.gel[None]], replace(around, gel=done.pose), SEARCHED)
        self.blocked = done.path < _BLOCKED * motion.length
        return done.path > min(_SHOWN, _BLOCKED * motion.length)

    def _can_leap(self, way: np.ndarray) -> bool:
        """Return whether the poses above a way (N, 4, 4), and its end, are within the box and cone of `reach`."""
        return self._reach.holds(np.concatenate([_raised(way), way[-1:]]))

    def _leap(self, ways: Sequence[np.ndarray], around: Surroundings, searched: float | None = None) -> Plan[bool]:
        searched = searched or (self._down if around.mesh is None else SEARCHED)
        able = []
        for way in ways:
            if not self._can_leap(way):
                continue
            if self._reach.asks:
                passed = np.concatenate([_raised(np.concatenate([around.gel[None], way])), way[-1:]])
                if not (yield from self._said_to_be_reached(passed)):
                    continue
            able.append(way)
        if not able:
            return False
        self.blocked = False
        went = yield from carried_out(leap(able, searched), self._do)
        self.lifts += went
        return went

    def _straight_to(self, place: np.ndarray) -> Plan[bool]:
        """Fly straight to above a place (4, 4), and go down there; return whether it touches then."""
        over = _raised(place[None])
        if not self._can_leap(place[None]):
            return False
        if self._reach.asks and not (yield from self._said_to_be_reached(np.concatenate([over, place[None]]))):
            return False
        if not (yield from self._do(Approach(over[0]))).success:
            return False
        touched = (yield from self._do(Touch(CLEARANCES[0] + SEARCHED))).touching
        self.lifts += touched
        return touched

    def _said_to_be_reached(self, poses: np.ndarray) -> Plan[bool]:
        """Ask by `CheckReach` whether the arm reaches all of these poses (N, 4, 4); return the answer."""
        answer = yield CheckReach(poses)
        if not answer.success:
            self.why_not = answer.message
        return answer.success

    def _do(self, act: Act | CheckReach) -> Plan[Done]:
        """Carry out one act, and note its end."""
        done = yield act
        self.touching, self.gel = done.touching, done.pose
        if done.touching and self._reach.holds(done.pose[None]):
            self._places.append(done.pose)
        if not done.success:
            self.why_not = done.message
        return done


def _way(motion: Motion, around: Surroundings) -> np.ndarray:
    """Poses (N, 4, 4) of the gel on a slide."""
    return around.track(motion.heading, motion.length).poses


def _raised(poses: np.ndarray) -> np.ndarray:
    """Raise poses (N, 4, 4) to the lowest clearance of a leap."""
    return poses @ se3.translation([0.0, 0.0, CLEARANCES[0]])


def _distance(around: Surroundings, goal: np.ndarray) -> float:
    """Straight distance [m] from the surface point nearest to the gel to a position (3,) on the surface."""
    return float(np.linalg.norm(around.over(around.gel[:3, 3])[:3, 3] - goal))


def _comes_nearer(track: SurfaceTrack, goal: np.ndarray) -> bool:
    """Return whether each step of a track leads towards a position (3,)."""
    left = np.linalg.norm(track.poses[:, :3, 3] - goal, axis=1)
    return len(left) > 1 and bool((np.diff(left) < -MIN_PROGRESS * np.diff(track.gone)).all())
