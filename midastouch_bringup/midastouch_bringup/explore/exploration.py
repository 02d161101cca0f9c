"""How an arm explores: which motion it makes next, by what the filter says; without knowing which arm it is."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from midastouch_common import se3
from midastouch_filter.active_touch.suggestion import Advice
from midastouch_perception.simulation.slide import MIN_PROGRESS

from .acts import Act, CheckReach, Done, Lift, Plan, Slide, Touch, carried_out
from .leap import CLEARANCES, SEARCHED, leap, ways_along, ways_to
from .reach import EVERYWHERE, Reach
from .surroundings import Surroundings, Track

TELLS = 0.1
"""nats: a motion that tells so much is worth its way, though it may not tell hypotheses apart for certain."""

_TRIES = 8  # random slides, and as many leaps, before the finger counts as stuck
_LEAPS = 0.25  # fraction of the motions at random: slides alone stay for long where they began
_MOST_FRUITLESS = 3  # motions in a row in which nothing is measured, or refused or hopeless suggestions
_SURE = 2  # motions in a row after which the filter knows: what is wrong seldom outlives another one
_BLOCKED = 0.5  # of its length: a slide that ends before that has met something to lift over
_RANDOM_LENGTHS = 0.1, 0.25  # shortest and longest random slide, of the object's diagonal, as of simulated slides
_NEAR = 1e-3  # m from a position that a person shows: there
_BESIDE = 0.013  # m, of a gel: another place
_SLIDES_TO = 4  # such a position, each along the chord of what is left

_T = TypeVar("_T")


@dataclass(frozen=True)
class Motion:
    """A slide, or with `lift` a leap, in direction `heading` [rad] of the gel's plane, over `length` [m]."""

    heading: float
    length: float
    lift: bool = False


@dataclass(frozen=True)
class Verdict:
    """How an exploration ended: whether the pose is `known`, and why in words."""

    known: bool
    words: str


class Exploration:
    """Decides on motions, as plans of acts that somebody carries out.

    Attributes: path [m] on the surface; slides and lifts, how many; touching, whether the gel does after the newest
    act; verdict, once it is over.
    Args: max_path [m], after which it gives up; reach, what is out of which is left out; down [m], how far it looks for
    a surface that it knows nothing of; size [m] of an object of which nothing is known; held(): whether it is to begin
    no further motion by itself.
    """

    def __init__(
        self,
        rng: np.random.Generator,
        max_path: float,
        reach: Reach = EVERYWHERE,
        down: float = 0.05,
        size: float = 0.1,
        held: Callable[[], bool] = lambda: False,
    ):
        self._rng, self._max_path, self._reach, self._down, self._size = rng, max_path, reach, down, size
        self._held = held
        self.restart()

    def restart(self) -> None:
        """Begin anew, as after a change of the object: no path, no motions, no verdict."""
        self.path, self.slides, self.lifts = 0.0, 0, 0
        self.touching = False
        self.verdict: Verdict | None = None
        self._unmeasured = self._refused = self._hopeless = self._sure = 0
        self._blocked = self._searching = False
        self._why_not, self._gel = "", np.eye(4)
        self._places: list[np.ndarray] = []  # T_base_gel where it has touched within the arm's reach

    # --- what comes next

    def touch(self) -> Plan[None]:
        """Down onto the surface; beside it, where that cannot be touched."""
        done = yield from self._do(Touch(self._down))
        self.lifts += done.touching
        if not done.touching:
            lifted = yield from self._do(Lift(max(done.path, CLEARANCES[0])))
            yield from self.go([], Surroundings(lifted.pose))
        if not (self.touching or self._held()):
            words = f"the finger reaches nothing below it: {done.message}"
            self.verdict = Verdict(False, f"{words}; is the mount right, and does the sensor see what it touches?")

    def decide(self, advice: Advice | None, around: Surroundings, state: str = "") -> tuple[str, Plan[None]]:
        """The next motion, and why in words; advice: that of `suggest_motion`, None if there is none; state: the
        filter's. While it is searching the object is hardly where it is believed to be: slides come first, which
        lead somewhere all the same."""
        self._searching = state == "searching"
        if advice is None:
            return "somewhere, as nothing better is known", self.go([], around)
        if advice.indistinguishable and not any(each.information > TELLS for each in advice.suggestions):
            self._hopeless += 1
            if self._hopeless >= _MOST_FRUITLESS:
                self.verdict = Verdict(False, f"nothing tells the poses apart: {advice.message}")
            leaps = [self._random_leap(around) for _ in range(_TRIES)]
            return "elsewhere, as nothing within reach would tell", self.go(leaps, around)
        self._refused = self._hopeless = 0
        # the best by metre are mere steps; each motion is awaited, so that one that tells much is worth its way
        best = sorted(advice.suggestions, key=lambda each: -each.information)
        able = [each for each in best if self._reachable(Motion(each.heading, each.length, each.lift), around)]
        reason = able[0].reason if able else "somewhere, as nothing better is within reach"
        return reason, self.go([Motion(each.heading, each.length, each.lift) for each in able], around)

    def go(self, suggested: Sequence[Motion], around: Surroundings) -> Plan[None]:
        """The first of these motions that can be carried out; without one of them one at random; none while it is held.

        Lifts come first where the last slide was blocked: what it was to find out is behind that. Off a surface that
        nothing is known of the finger goes back to it: a leap at random seldom finds one.
        """
        if around.mesh is None and not self.touching and (yield from self._back()):
            return
        if self._blocked or self._searching:
            suggested = sorted(suggested, key=lambda each: each.lift == self._searching)
        slides = [self._random_slide(around) for _ in range(_TRIES)]
        leaps = [self._random_leap(around) for _ in range(_TRIES)]
        doubtful = self._searching or around.mesh is None
        leap_first = (self._rng.random() < _LEAPS and not doubtful) or not self.touching
        at_random = [*leaps, *slides] if leap_first else [*slides, *leaps]
        self._why_not = "every way is out of the arm's reach"
        left = [*suggested, *at_random]
        while left:
            if self._held():
                return
            motion, before = left.pop(0), self._gel
            if not self._reachable(motion, around):
                continue
            # where a surface is believed and none is found the belief is wrong, and of other places, too
            if (yield from self.obey(motion, around, others=around.mesh is None)):
                return
            if motion.lift and self.touching and self._gel is not before:  # slides need no belief
                left.sort(key=lambda each: each.lift)
        if self._held():
            return
        if around.mesh is not None:  # where the object is believed to be, which may be wrong
            yield from self.go([], Surroundings(self._gel))
            return
        if (yield from self._back()):
            return
        self.verdict = Verdict(
            False, f"the finger is stuck: it can neither slide on nor touch elsewhere: {self._why_not}"
        )

    def judge(self, state: str, why: str, measured: bool) -> None:
        """Look at the filter's state after a motion, its reason, and whether it has `measured` what the finger
        touches; a verdict that there is stays."""
        if self.verdict is not None:
            return
        self._unmeasured = 0 if measured or not self.touching else self._unmeasured + 1
        self._sure = self._sure + 1 if state == "converged" else 0
        if self._sure >= _SURE:
            self.verdict = Verdict(True, f"the filter knows the pose: {why}")
        elif self._unmeasured >= _MOST_FRUITLESS:
            words = (
                f"the filter has measured nothing for {_MOST_FRUITLESS} motions: "
                "does it get this sensor's images, and is its object the one that is touched?"
            )
            self.verdict = Verdict(False, words)
        elif self.path > self._max_path:
            self.verdict = Verdict(False, f"still {state} after {self.path:.2f} m: {why}")

    def refused(self, why: str) -> None:
        """Take note that `suggest_motion` gave no suggestion, for a reason in words."""
        self._refused += 1
        if self._refused >= _MOST_FRUITLESS:
            self.verdict = Verdict(False, f"no suggestion where to touch next: {why}")

    # --- what a person wants

    def obey(self, motion: Motion, around: Surroundings, others: bool = True) -> Plan[bool]:
        """This very motion, as far as it can be carried out; whether it went anywhere. others: whether a leap tries
        what is near where it cannot touch."""
        if not motion.lift:
            return (yield from self._slide(motion, around))
        ways = ways_along(around, motion.heading, motion.length)
        return (yield from self._leap(ways if others else ways[:1], around))

    def leap(self, around: Surroundings) -> Plan[bool]:
        """Lift, and touch elsewhere at random."""
        return self.obey(self._random_leap(around), around)

    def visit(self, position: np.ndarray, around: Surroundings) -> Plan[bool]:
        """Touch the surface next to a position (3,) m of the base frame: slide there if that leads there, else lift.

        Whether it touches there then, and not only as near as it can.
        """
        goal = around.over(position)[:3, 3]
        for _ in range(_SLIDES_TO):
            track = around.towards(goal, _distance(around, goal))
            if _distance(around, goal) < _NEAR or not _comes_nearer(track, goal):
                break
            motion = Motion(track.heading, track.gone[-1])
            if not (yield from self._slide(motion, around)):
                break
            around = replace(around, gel=self._gel)
        if _distance(around, goal) > _NEAR or not self.touching:
            yield from self._leap(ways_to(around, goal), around)
            around = replace(around, gel=self._gel)
        self._blocked = False
        return self.touching and _distance(around, goal) < _NEAR

    # --- motions

    def _random_slide(self, around: Surroundings) -> Motion:
        """Somewhere, straight on."""
        size = self._size if around.mesh is None else around.mesh.diagonal
        length = size * self._rng.uniform(*_RANDOM_LENGTHS)
        return Motion(self._rng.uniform(0, 2 * np.pi), length)

    def _random_leap(self, around: Surroundings) -> Motion:
        """Somewhere else, up to half of the object away."""
        slide = self._random_slide(around)
        return Motion(slide.heading, 2 * slide.length, lift=True)

    def _reachable(self, motion: Motion, around: Surroundings) -> bool:
        if motion.lift:
            return self._can_leap(ways_along(around, motion.heading, motion.length)[0])
        return self._reach.holds(_way(motion, around))

    def _slide(self, motion: Motion, around: Surroundings) -> Plan[bool]:
        if not self.touching:
            return False
        if self._reach.asks:
            way = _way(motion, around)  # of which it is at the first pose
            if not (yield from self._said_to_be_reached(np.concatenate([way[1:], _raised(way[-1:])]))):
                return False
        done = yield from self._do(Slide(motion.heading, motion.length))
        self.path += done.path
        self.slides += done.path > 0
        if not (done.touching and self._reach.holds(done.pose[None])):  # over an edge, or where nothing is within reach
            yield from self._leap([around.gel[None]], replace(around, gel=done.pose), SEARCHED)
        self._blocked = done.path < _BLOCKED * motion.length
        return done.path > 0

    def _can_leap(self, way: np.ndarray) -> bool:
        """Whether the arm reaches what is over a way (N, 4, 4), and its end."""
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
        self._blocked = False
        went = yield from self._watched(leap(able, searched))
        self.lifts += went
        return went

    def _back(self) -> Plan[bool]:
        """To the last of the places that it has touched at; but for the first, those near one where it cannot stay are
        forgotten."""
        if not self._places:
            return False
        first, *later = self._places
        while not self._held():
            place = later[-1] if later else first
            came = yield from self._leap([place[None]], Surroundings(self._gel), SEARCHED)
            if came and self._reach.holds(self._gel[None]):
                return True
            if not later:
                break
            later = [each for each in later if np.linalg.norm((each - place)[:3, 3]) > _BESIDE]
            self._places = [first, *later]
        return False

    def _said_to_be_reached(self, poses: np.ndarray) -> Plan[bool]:
        """Whether whoever knows the arm says that it reaches all of these poses (N, 4, 4)."""
        answer = yield CheckReach(poses)
        if not answer.success:
            self._why_not = answer.message
        return answer.success

    def _watched(self, plan: Plan[_T]) -> Plan[_T]:
        """A plan, while what its acts come to is noted."""
        return (yield from carried_out(plan, self._do))

    def _do(self, act: Act) -> Plan[Done]:
        """One act, whose end is noted."""
        done = yield act
        self.touching, self._gel = done.touching, done.pose
        if done.touching and self._reach.holds(done.pose[None]):
            self._places.append(done.pose)
        if not done.success:
            self._why_not = done.message
        return done


def _way(motion: Motion, around: Surroundings) -> np.ndarray:
    """Poses (N, 4, 4) of the gel on a slide."""
    return around.track(motion.heading, motion.length).poses


def _raised(poses: np.ndarray) -> np.ndarray:
    """Poses (N, 4, 4) at the lowest clearance of a leap."""
    return poses @ se3.translation([0.0, 0.0, CLEARANCES[0]])


def _distance(around: Surroundings, goal: np.ndarray) -> float:
    """m along the surface, about, to a position (3,) of it."""
    return float(np.linalg.norm(around.over(around.gel[:3, 3])[:3, 3] - goal))


def _comes_nearer(track: Track, goal: np.ndarray) -> bool:
    """Whether each step of a way leads towards a position (3,)."""
    left = np.linalg.norm(track.poses[:, :3, 3] - goal, axis=1)
    return len(left) > 1 and bool((np.diff(left) < -MIN_PROGRESS * np.diff(track.gone)).all())
