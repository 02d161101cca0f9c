"""Grasps: several gels that touch an object at once, where the fingers of one hand could be."""

from __future__ import annotations

import numpy as np

from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh

from ..rendering.contact_poses import ContactSampling, sample_contact_poses
from ..sensor_model import SensorModel

CONTACTS = 4
"""Fingers of the hand: a thumb and three others."""

_SPAN = 0.12  # m between two gels: an open hand
_FINGER = 0.015  # m: a DIGIT as a ball behind its gel, radius and how far its centre is behind
_POOL = 400  # contacts among which a grasp is looked for
_TRIES = 64
_SAMPLING = ContactSampling(edge_fraction=0.0, free_fraction=0.0)


def simulate_grasps(mesh: ObjectMesh, sensor: SensorModel, count: int, rng: np.random.Generator) -> np.ndarray:
    """Gel poses T_obj_gel (count, CONTACTS, 4, 4) of so many grasps.

    The first finger touches anywhere, the second one opposite to it as far as the object allows, the others anywhere
    within the hand's span; fingers do not run into each other. Raises InputError if the object has no such contacts.
    """
    pool = sample_contact_poses(mesh, _POOL, rng, sensor, _SAMPLING)
    grasps: list[np.ndarray] = []
    for _ in range(_TRIES * count):
        if len(grasps) == count:
            break
        if (chosen := _grasp(pool, int(rng.integers(len(pool))), rng)) is not None:
            grasps.append(pool[chosen])
    if len(grasps) < count:
        raise InputError(f"{mesh.name}: no room for {CONTACTS} fingers at once; is the object too small for a hand?")
    return np.stack(grasps)


def _grasp(pool: np.ndarray, first: int, rng: np.random.Generator) -> list[int] | None:
    """CONTACTS of the poses (N, 4, 4), beginning with the `first`; None if there is no room."""
    chosen, free = [first], _beside(pool, first)
    while len(chosen) < CONTACTS:
        left = np.flatnonzero(free)
        if not len(left):
            return None
        opposition = _opposition(pool, first)[left]
        chosen.append(int(left[opposition.argmax()] if len(chosen) == 1 else rng.choice(left)))
        free &= _beside(pool, chosen[-1])
    return chosen


def _beside(pool: np.ndarray, one: int) -> np.ndarray:
    """Which (N,) of the poses another finger can take beside one of them."""
    centres = pool[:, :3, 3] + _FINGER * pool[:, :3, 2]
    apart = np.linalg.norm(centres - centres[one], axis=1) >= 2 * _FINGER
    return apart & (np.linalg.norm(pool[:, :3, 3] - pool[one, :3, 3], axis=1) <= _SPAN)


def _opposition(pool: np.ndarray, one: int) -> np.ndarray:
    """How well (N,) each of the poses opposes one of them: 2 where both press along the line between them."""
    line = pool[:, :3, 3] - pool[one, :3, 3]
    line /= np.maximum(np.linalg.norm(line, axis=1, keepdims=True), 1e-9)
    return (line * pool[:, :3, 2]).sum(axis=1) - line @ pool[one, :3, 2]
