"""How a simulated finger explores: the world that it touches, and which motion it makes next."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.simulation.finger import SimulatedFinger

from ..bags.messages import BASE_FROM_OBJECT

PUSH = 6e-3, np.radians(5.0)
"""m, rad: about what the filter's test of a moved object is made for."""

TELLS = 0.1
"""nats: a motion that tells so much is worth its way, though it may not tell hypotheses apart for certain."""


class World:
    """Attributes: mesh; finger; base_from_object, T_base_obj (4, 4).

    Args: step [m], way of the finger between two images. Raises InputError if nothing of the object can be touched.
    """

    def __init__(self, mesh: ObjectMesh, sensor: SensorModel, rng: np.random.Generator, step: float):
        self._sensor, self._rng, self._step = sensor, rng, step
        self.base_from_object = BASE_FROM_OBJECT
        self.put(mesh)

    @property
    def base_from_gel(self) -> np.ndarray:
        """T_base_gel (4, 4)."""
        return self.base_from_object @ self.finger.pose

    def put(self, mesh: ObjectMesh) -> None:
        """Another object instead of the present one, the finger over a random point of it."""
        self.finger = SimulatedFinger(mesh, self._sensor, self._rng, self._step)
        self.mesh = mesh

    def push(self) -> Iterator[np.ndarray]:
        """Move the object, 6 mm in a random direction of the gel's plane and 5 deg about its axis; the finger stays.

        Yields T_obj_gel (4, 4), one per image.
        """
        distance, angle = PUSH
        count = int(np.ceil(distance / self._step))
        direction = self._rng.uniform(0, 2 * np.pi)
        about_gel = np.array([np.cos(direction) * distance, np.sin(direction) * distance, 0, 0, 0, angle]) / count
        gel = self.finger.pose.copy()
        moved = gel @ se3.exp(about_gel) @ se3.inverse(gel)  # T_old_new of the object's frame
        for _ in range(count):
            self.base_from_object = self.base_from_object @ moved
            yield self.finger.stay_in_place(moved)


_TRIES = 8  # random slides, and as many leaps, before the finger counts as stuck
_LEAPS = 0.25  # fraction of the motions at random: slides alone stay for long where they began
_MOST_FRUITLESS = 3  # motions in a row in which nothing is measured, or refused or hopeless suggestions
_SURE = 2  # motions in a row after which the filter knows: what is wrong seldom outlives another one
_BLOCKED = 0.5  # of its length: a slide that ends before that has met something to lift over
_RANDOM_LENGTHS = 0.1, 0.25  # shortest and longest random slide, of the object's diagonal, as of simulated slides

Poses = Iterator[np.ndarray]


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
    """Moves the finger of a world; its motions yield poses T_obj_gel (4, 4), one per image.

    Attributes: path [m] on the surface; slides and lifts, how many; verdict, once it is over.
    Args: max_path [m], after which it gives up.
    """

    def __init__(self, world: World, rng: np.random.Generator, max_path: float):
        self.world, self._rng, self._max_path = world, rng, max_path
        self.restart()

    def restart(self) -> None:
        """Begin anew, as after a change of the object: no path, no motions, no verdict."""
        self.path, self.slides, self.lifts = 0.0, 0, 0
        self.verdict: Verdict | None = None
        self._unmeasured = self._refused = self._hopeless = self._sure = 0
        self._blocked = False

    def touch(self) -> Poses:
        """Down onto the surface."""
        if not (yield from self._carry_out(Motion(0.0, 0.0, lift=True))):
            self.verdict = Verdict(False, f"the finger does not reach {self.world.mesh.name} below it")

    def go(self, suggested: Sequence[Motion]) -> Poses:
        """The first of these motions that can be carried out; without one of them one at random.

        Lifts come first where the last slide was blocked: what it was to find out is behind that.
        """
        suggested = sorted(suggested, key=lambda motion: not motion.lift) if self._blocked else suggested
        slides = [self.random_slide() for _ in range(_TRIES)]
        leaps = [self.random_leap() for _ in range(_TRIES)]
        at_random = [*leaps, *slides] if self._rng.random() < _LEAPS else [*slides, *leaps]
        for motion in [*suggested, *at_random]:
            if (yield from self._carry_out(motion)):
                return
        name = self.world.mesh.name
        self.verdict = Verdict(False, f"the finger is stuck: it can neither slide on nor lift over {name}")

    def random_slide(self) -> Motion:
        """Somewhere, straight on."""
        length = self.world.mesh.diagonal * self._rng.uniform(*_RANDOM_LENGTHS)
        return Motion(self._rng.uniform(0, 2 * np.pi), length)

    def random_leap(self) -> Motion:
        """Somewhere else, up to half of the object away."""
        slide = self.random_slide()
        return Motion(slide.heading, 2 * slide.length, lift=True)

    def judge(self, state: str, why: str, measured: bool) -> None:
        """Look at the filter's state after a motion, its reason, and whether it has `measured` what the finger
        touches."""
        self._unmeasured = 0 if measured or not self.world.finger.touching else self._unmeasured + 1
        self._sure = self._sure + 1 if state == "converged" else 0
        if self._sure >= _SURE:
            self.verdict = Verdict(True, f"the filter knows the pose: {why}")
        elif self._unmeasured >= _MOST_FRUITLESS:
            words = (
                f"the filter has measured nothing for {_MOST_FRUITLESS} motions: "
                "has it the simulator's images and object?"
            )
            self.verdict = Verdict(False, words)
        elif self.path > self._max_path:
            self.verdict = Verdict(False, f"still {state} after {self.path:.2f} m: {why}")

    def refused(self, why: str) -> None:
        """Take note that `suggest_motion` gave no suggestion, for a reason in words."""
        self._refused += 1
        if self._refused >= _MOST_FRUITLESS:
            self.verdict = Verdict(False, f"no suggestion where to touch next: {why}")

    def hopeless(self, why: str) -> Sequence[Motion]:
        """Nothing within reach tells the poses apart, for this reason. Motions to where something else is in reach."""
        self._hopeless += 1
        if self._hopeless >= _MOST_FRUITLESS:
            self.verdict = Verdict(False, f"nothing tells the poses apart: {why}")
        return [self.random_leap() for _ in range(_TRIES)]

    def accepted(self) -> None:
        """There are suggestions again."""
        self._refused = self._hopeless = 0

    def obey(self, motion: Motion) -> Poses:
        """This very motion, as far as it can be carried out."""
        yield from self._carry_out(motion)

    def visit(self, point: np.ndarray) -> Generator[np.ndarray, None, bool]:
        """Touch the surface next to a point (3,) of the object's frame: slide there if that leads there, else lift.

        Whether it touches there then, and not only as near as it can.
        """
        finger = self.world.finger
        (goal,), _, _ = self.world.mesh.closest_points(point[None])
        for move, lift in (finger.slide_to, False), (finger.leap_to, True):
            if not finger.touches(goal):
                yield from self._count(move(goal), lift)
        self._blocked = False
        return finger.touches(goal)

    def _carry_out(self, motion: Motion) -> Generator[np.ndarray, None, bool]:
        """Whether it went anywhere."""
        finger, before = self.world.finger, self.path
        move = finger.leap if motion.lift else finger.slide
        went = yield from self._count(move(motion.heading, motion.length), motion.lift)
        self._blocked = not motion.lift and self.path - before < _BLOCKED * motion.length
        return went

    def _count(self, poses: Poses, lift: bool) -> Generator[np.ndarray, None, bool]:
        """Move along, by the surface or with a lift; whether it went anywhere."""
        last, went = self.world.finger.pose[:3, 3], False
        for pose in poses:
            if not lift:
                self.path += float(np.linalg.norm(pose[:3, 3] - last))
            last, went = pose[:3, 3], True
            yield pose
        self.lifts += went and lift
        self.slides += went and not lift
        return went
