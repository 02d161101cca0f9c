"""Arms that carry out plans without ROS."""

from __future__ import annotations

import numpy as np

from midastouch_motion.exploration.acts import Done, Lift, Slide, carried_out
from midastouch_motion.exploration.surroundings import Surroundings
from midastouch_simulation.world import World


def followed(world: World, plan):
    """Poses T_obj_gel of a plan, and what it came to."""
    return ended(world.follow(plan))


def ended(steps):
    """What a generator yields, and what it returns."""
    yielded = []
    while True:
        try:
            yielded.append(next(steps))
        except StopIteration as end:
            return yielded, end.value


def seen(world: World, known: bool = True) -> Surroundings:
    """What is around the finger, with or without the object."""
    if not known:
        return Surroundings(world.base_from_gel)
    return Surroundings(world.base_from_gel, world.base_from_object, world.mesh)


class Scripted:
    """An arm whose acts end as it is told. answer(act): success, message, path, touching, pose; acts, that it was
    asked for."""

    def __init__(self, answer):
        self._answer, self.acts = answer, []

    def follow(self, plan):
        return ended(carried_out(plan, self._carry_out))[1]

    def _carry_out(self, act):
        yield from ()  # it takes no time
        self.acts.append(act)
        assert len(self.acts) < 1000, "no end"
        return Done(*self._answer(act))


def refusing(act):
    """No arm moves before it is enabled."""
    return False, "not enabled", 0.0, True, np.eye(4)


def over_an_edge(act):
    """Slides lose the contact; touches find it again."""
    if isinstance(act, Slide):
        return False, "the contact was lost after 8 mm", 0.008, False, np.eye(4)
    return True, "", 0.0, not isinstance(act, Lift), np.eye(4)
