"""How an arm explores: which motion it makes next, by what the filter says; without knowing which arm it is."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from midastouch_filter.active_touch.suggestion import Advice
from midastouch_filter.core.state import CONVERGED, SEARCHING

from .acts import Plan
from .motions import Motion, Motions
from .reach import EVERYWHERE, Reach
from .surroundings import Surroundings

TELLS = 0.1
"""nats: a motion that tells so much is worth its way, though it may not tell hypotheses apart for certain."""

_TRIES = 8  # random slides, and as many leaps, before the finger counts as stuck
_LEAPS = 0.25  # fraction of the motions at random: slides alone stay for long where they began
_MOST_FRUITLESS = 3  # in a row: of motions that measure nothing or are not possible, of suggestions that are no help
_SURE = 2  # motions in a row after which the filter knows: what is wrong seldom outlives another one
_RANDOM_LENGTHS = 0.1, 0.25  # shortest and longest random slide, of the object's diagonal, as of simulated slides


@dataclass(frozen=True)
class Verdict:
    """How an exploration ended: whether the pose is `known`, and why in words."""

    known: bool
    words: str


class Exploration:
    """Decides on motions, as plans of acts that somebody carries out.

    Attributes: motions, what was done; verdict, once it is over.
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
        self.motions = Motions(self._reach, self._down, self._held)
        self.verdict: Verdict | None = None
        self._unmeasured = self._refused = self._hopeless = self._stuck = self._sure = 0
        self._doubtful = False  # whether the object is hardly where it is believed to be

    def touch(self) -> Plan[None]:
        """Down onto the surface; beside it, where that cannot be touched."""
        done = yield from self.motions.touch()
        if not done.touching:
            yield from self.go([], Surroundings(self.motions.gel))
        if not (self.motions.touching or self._held()):
            words = f"the finger reaches nothing below it: {done.message}"
            self.verdict = Verdict(False, f"{words}; is the mount right, and does the sensor see what it touches?")

    def decide(self, advice: Advice | None, around: Surroundings, state: str = "") -> tuple[str, Plan[None]]:
        """The next motion, and why in words; advice: that of `suggest_motion`, None if there is none; state: the
        filter's.

        While it is searching the object is hardly where it is believed to be: slides come first, which lead somewhere
        all the same. Else lifts do where the last slide was blocked: what it was to find out is behind that.
        """
        self._doubtful = state == SEARCHING
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
        reasons = {Motion(each.heading, each.length, each.lift): each.reason for each in best}
        able = [motion for motion in reasons if self.motions.reachable(motion, around)]
        if self.motions.blocked or self._doubtful:
            able.sort(key=lambda each: each.lift == self._doubtful)
        return reasons[able[0]] if able else "somewhere, as nothing better is within reach", self.go(able, around)

    def go(self, suggested: Sequence[Motion], around: Surroundings) -> Plan[None]:
        """The first of these motions that can be carried out; without one of them one at random; none while it is held.

        Off a surface that nothing is known of the finger goes back to it: a leap at random seldom finds one.
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
            # where a surface is believed and none is found the belief is wrong, and of other places, too
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
        if around.mesh is not None:  # where the object is believed to be, which may be wrong
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

    def judge(self, state: str, why: str, measured: bool) -> None:
        """Look at the filter's state after a motion, its reason, and whether it has `measured` what the finger
        touches; a verdict that there is stays."""
        if self.verdict is not None:
            return
        self._unmeasured = 0 if measured or not self.motions.touching else self._unmeasured + 1
        self._sure = self._sure + 1 if state == CONVERGED else 0
        if self._sure >= _SURE:
            self.verdict = Verdict(True, f"the filter knows the pose: {why}")
        elif self._unmeasured >= _MOST_FRUITLESS:
            words = (
                f"the filter has measured nothing for {_MOST_FRUITLESS} motions: "
                "does it get this sensor's images, and is its object the one that is touched?"
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
        """Somewhere, straight on."""
        size = self._size if around.mesh is None else around.mesh.diagonal
        length = size * self._rng.uniform(*_RANDOM_LENGTHS)
        return Motion(self._rng.uniform(0, 2 * np.pi), length)

    def _random_leap(self, around: Surroundings) -> Motion:
        """Somewhere else, up to half of the object away."""
        slide = self._random_slide(around)
        return Motion(slide.heading, 2 * slide.length, lift=True)
