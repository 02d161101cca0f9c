"""Arms that carry out plans without ROS."""

from __future__ import annotations

import numpy as np

from midastouch_bringup.explore.acts import Done, Lift, Slide
from midastouch_bringup.explore.surroundings import Surroundings
from midastouch_bringup.explore.world import World


def followed(world: World, plan):
    """Poses T_obj_gel of a plan, and what it came to."""
    poses = []
    steps = world.follow(plan)
    while True:
        try:
            poses.append(next(steps))
        except StopIteration as end:
            return poses, end.value


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
        done = None
        while True:
            try:
                act = plan.send(done)
            except StopIteration as end:
                return end.value
            self.acts.append(act)
            assert len(self.acts) < 1000, "no end"
            done = Done(*self._answer(act))


def refusing(act):
    """No arm moves before it is enabled."""
    return False, "not enabled", 0.0, True, np.eye(4)


def over_an_edge(act):
    """Slides lose the contact; touches find it again."""
    if isinstance(act, Slide):
        return False, "the contact was lost after 8 mm", 0.008, False, np.eye(4)
    return True, "", 0.0, not isinstance(act, Lift), np.eye(4)
