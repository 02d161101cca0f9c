"""Decisions of an exploration: the next motion, chosen by the filter's answers; independent of the kind of arm."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from midastouch_filter.active_touch.suggestion import Advice
from midastouch_filter.core.state import CONVERGED, FOREIGN, SEARCHING

from .acts import Plan
from .motions import Motion, Motions
from .reach import EVERYWHERE, Reach
from .surroundings import Surroundings

TELLS = 0.1
"""nats; a motion with this much information is worth its path, even if it may not separate hypotheses for certain."""

_TRIES = 8  # random slides, and as many leaps, before the finger counts as stuck
_LEAPS = 0.25  # fraction of leaps among random motions: slides alone stay near their start for long
_MOST_FRUITLESS = 3  # in a row: motions that measure nothing or are not possible, suggestions that do not help
_SURE = 2  # motions in a row after which an answer of the filter is taken: a wrong one seldom survives another one
_RANDOM_LENGTHS = 0.1, 0.25  # shortest and longest random slide, times the object's diagonal, as in simulated slides


@dataclass(frozen=True)
class Verdict:
    """End of an exploration: `known` is True if the pose is known, `foreign` if another object is touched; `words` give
    the reason."""

    known: bool
    words: str
    foreign: bool = False


class Exploration:
    """Exploration, which decides on motions as plans of acts; its user carries them out.

    Attributes: motions: those done so far; verdict: None until it is over.

    Parameters
    ----------
    rng
    max_path : path after which it gives up [m]
    reach
        Motions that leave it are not made.
    down : depth to which it searches for an unknown surface [m]
    size : assumed diagonal of an unknown object [m]
    held
        Function that returns True while it must not begin a further motion by itself.
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
        """Start again, as after a change of the object: no path, no motions, no verdict."""
        self.motions = Motions(self._reach, self._down, self._held)
        self.verdict: Verdict | None = None
        self._unmeasured = self._refused = self._hopeless = self._stuck = self._sure = self._foreign = 0
        self._doubtful = False  # True if the object is probably not where it is believed to be

    def touch(self) -> Plan[None]:
        """Go down onto the surface, or next to it if it cannot be touched below."""
        done = yield from self.motions.touch()
        if not done.touching:
            yield from self.go([], Surroundings(self.motions.gel))
        if not (self.motions.touching or self._held()):
            words = f"the finger reaches nothing below it: {done.message}"
            self.verdict = Verdict(False, f"{words}; is the mount right, and does the sensor see what it touches?")

    def decide(self, advice: Advice | None, around: Surroundings, state: str = "") -> tuple[str, Plan[None]]:
        """Decide on the next motion; return the reason, for people, and the plan.

        While the filter is `searching`, slides are tried before lifts, because they work without a known object pose.
        Otherwise, if an obstacle stopped the last slide, lifts are tried first: they pass over it.

        Parameters
        ----------
        advice
            Answer of `suggest_motion`, None if there is none.
        around
            Surface around the gel, as far as it is known.
        state
            State of the filter.
        """
        self._doubtful = state == SEARCHING
        if advice is None:
            return "somewhere, as nothing better is known", self.go([], around)
        if advice.indistinguishable and not any(each.information > TELLS for each in advice.suggestions):
            self._hopeless += 1
            if self._hopeless >= _MOST_FRUITLESS:
                self.verdict = Verdict(False, f"no motion tells the poses apart: {advice.message}")
            leaps = [self._random_leap(around) for _ in range(_TRIES)]
            return "elsewhere, as no touch within reach is informative", self.go(leaps, around)
        self._refused = self._hopeless = 0
        # by information, as the best per metre are tiny steps: each motion has to be awaited, so a long one can pay
        best = sorted(advice.suggestions, key=lambda each: -each.information)
        reasons = {Motion(each.heading, each.length, each.lift): each.reason for each in best}
        able = [motion for motion in reasons if self.motions.reachable(motion, around)]
        if self.motions.blocked or self._doubtful:
            able.sort(key=lambda each: each.lift == self._doubtful)
        return reasons[able[0]] if able else "somewhere, as nothing better is within reach", self.go(able, around)

    def go(self, suggested: Sequence[Motion], around: Surroundings) -> Plan[None]:
        """Carry out the first of some motions that is possible, otherwise a random one; none while it is held.

        If it has lost a surface that it does not know, it goes back to it: a random leap seldom finds one.

        Parameters
        ----------
        suggested
            The motions, best first.
        around
            As for `decide`.
        """
        unknown = around.mesh is None or self._doubtful
        if unknown and not self.motions.touching and (yield from self.motions.back()):
            return
        slides = [self._random_slide(around) for _ in range(_TRIES)]
        leaps = [self._random_leap(around) for _ in range(_TRIES)]
        leap_first = (self._rng.random() < _LEAPS and not self._doubtful) or not self.motions.touching
        at_random = [*leaps, *slides] if leap_first else [*slides, *leaps]
        self.motions.why_not = "every way is out of the arm's reach"
        left = [*suggested, *at_random]
        while left:
            if self._held():
                return
            motion, before = left.pop(0), self.motions.gel
            if not self.motions.reachable(motion, around):
                continue
            # if a believed surface is not found, the belief is wrong, also about positions near it
            if (yield from self.motions.carry_out(motion, around, others=around.mesh is None)):
                self._stuck = 0
                return
            if self.motions.gel is before:
                continue
            around = replace(around, gel=self.motions.gel)
            if motion.lift and self.motions.touching:  # slides need no belief
                left.sort(key=lambda each: each.lift)
        if self._held():
            return
        if around.mesh is not None:  # the belief about the object may be wrong: once more without it
            self._doubtful = True
            yield from self.go([], Surroundings(self.motions.gel))
            return
        self._stuck += 1
        if self._stuck < _MOST_FRUITLESS and (yield from self.motions.back()):
            return
        if self._held():
            return
        self.verdict = Verdict(
            False, f"the finger is stuck: it can neither slide on nor touch elsewhere: {self.motions.why_not}"
        )

    def judge(self, state: str, why: str, measured: bool, unknown: float = 0.0) -> None:
        """Set the verdict after a motion, if it is time; an earlier verdict stays.

        Parameters
        ----------
        state, why
            State of the filter, and its reason.
        measured
            True if the filter has measured the touched surface.
        unknown
            Probability that another object is touched.
        """
        if self.verdict is not None:
            return
        self._unmeasured = 0 if measured or not self.motions.touching else self._unmeasured + 1
        self._sure = self._sure + 1 if state == CONVERGED else 0
        self._foreign = self._foreign + 1 if unknown > FOREIGN else 0
        if self._sure >= _SURE:
            self.verdict = Verdict(True, f"the filter knows the pose: {why}")
        elif self._foreign >= _SURE:
            self.verdict = Verdict(False, f"another object is touched, with {unknown:.1%}: {why}", foreign=True)
        elif self._unmeasured >= _MOST_FRUITLESS:
            words = (
                f"the filter has measured nothing for {_MOST_FRUITLESS} motions: "
                "does it receive this sensor's images, and is its object the touched one?"
            )
            self.verdict = Verdict(False, words)
        elif self.motions.path > self._max_path:
            self.verdict = Verdict(False, f"still {state} after {self.motions.path:.2f} m: {why}")

    def refused(self, why: str) -> None:
        """Take note that `suggest_motion` gave no suggestion, for a reason in words."""
        self._refused += 1
        if self._refused >= _MOST_FRUITLESS:
            self.verdict = Verdict(False, f"no suggestion where to touch next: {why}")

    def leap(self, around: Surroundings) -> Plan[bool]:
        """Lift, and touch elsewhere at random."""
        return self.motions.carry_out(self._random_leap(around), around)

    def _random_slide(self, around: Surroundings) -> Motion:
        """Return a slide of random heading and length."""
        size = self._size if around.mesh is None else around.mesh.diagonal
        length = size * self._rng.uniform(*_RANDOM_LENGTHS)
        return Motion(self._rng.uniform(0, 2 * np.pi), length)

    def _random_leap(self, around: Surroundings) -> Motion:
        """Return a leap of random heading, up to half of the object's diagonal away."""
        slide = self._random_slide(around)
        return Motion(slide.heading, 2 * slide.length, lift=True)
