"""Simulated grasps: poses of the gels of a hand that closes on an object, a thumb against one finger or two."""

from __future__ import annotations

import numpy as np

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_common.surface_walk import carried
from midastouch_perception.rendering.contact_poses import Reachability
from midastouch_perception.sensor_model import SensorModel

CONTACTS = 3
"""Number of fingers of the hand, including the thumb, which is the first."""

_OPENING = 0.12  # m from the thumb to the fingers of the open hand
_APART = 0.028, 0.045  # m between the two fingers, side by side
_PRESS = 0.3e-3, 1.5e-3  # m
_TILT = np.radians(4.0)  # sigma of a pad's error about each axis, after it has turned to the surface
_SLIPS = np.radians(40.0)  # a finger that meets the surface at a larger angle to its normal slides off
_BODY, _CLEAR = 0.015, 0.01  # m: distance of a finger's middle behind its gel, and free radius around it
_TRIES, _STEPS, _MET = 10_000, 40, 1e-4


def simulate_grasp(
    mesh: ObjectMesh, sensor: SensorModel, rng: np.random.Generator, contacts: int = CONTACTS
) -> np.ndarray:
    """Draw the gel poses T_obj_gel (contacts, 4, 4) of a grasp; with two contacts it is a pinch.

    The hand closes in a random direction about a random point of the surface. Each finger stops where it meets the
    surface, flat or sharp, turns to it as a soft pad does, and is pressed in. No finger slips, and none is inside the
    object or another finger. Raises InputError if the object has no such grasp.
    """
    reachability = Reachability(mesh, sensor)
    for _ in range(_TRIES):
        if (poses := _closed(mesh, reachability, rng, contacts)) is not None:
            return poses
    raise InputError(f"{mesh.name}: no room for {contacts} fingers at once; is the object too small for a hand?")


def _closed(mesh: ObjectMesh, reachability: Reachability, rng: np.random.Generator, contacts: int) -> np.ndarray | None:
    """Close one hand: return poses (contacts, 4, 4) of its gels; None if it gets no hold."""
    (about,), _, _ = mesh.sample_surface(1, rng)
    towards = rng.standard_normal((1, 3))
    towards /= np.linalg.norm(towards)
    hand = se3.frame_from_normal(towards, rng.uniform(0, 2 * np.pi, 1))[0]  # its z axis points to the thumb
    frames = hand @ np.stack([np.eye(3), *[np.diag([1.0, -1.0, -1.0])] * (contacts - 1)])
    middle = about + rng.uniform(-0.5, 0.5) * _OPENING * hand[:, 2]
    aside = rng.uniform(*_APART) * np.array([0.0, *(np.arange(contacts - 1) - (contacts - 2) / 2)])
    points = middle + aside[:, None] * hand[:, 0] + 0.5 * _OPENING * frames[:, :, 2]
    for _ in range(_STEPS):
        _, distance, _ = mesh.closest_points(points)
        points -= distance[:, None] * frames[:, :, 2]
        if np.abs((points - middle) @ hand[:, 2]).max() > _OPENING / 2:
            return None
    normals = mesh.smooth_normals(points)
    if distance.max() > _MET or (normals * frames[:, :, 2]).sum(axis=1).min() < np.cos(_SLIPS):
        return None
    if ((points[0] - points[1:]) @ hand[:, 2]).min() < 0:
        return None
    tilts = np.pad(rng.normal(0, _TILT, (contacts, 2)), ((0, 0), (3, 1)))
    turned = np.stack([carried(*each) for each in zip(frames, normals, strict=True)]) @ se3.exp(tilts)[:, :3, :3]
    poses, touching = reachability.pressed(se3.make(turned, points), rng.uniform(*_PRESS, contacts))
    return poses if touching.all() and _free(mesh, poses) else None


def _free(mesh: ObjectMesh, poses: np.ndarray) -> bool:
    """Return whether the fingers of gels at poses (N, 4, 4) are outside of the object and of each other."""
    bodies = poses[:, :3, 3] + _BODY * poses[:, :3, 2]
    closest, distance, _ = mesh.closest_points(bodies)
    outside = ((bodies - closest) * mesh.smooth_normals(closest)).sum(axis=1) > 0
    between = np.linalg.norm(bodies[:, None] - bodies, axis=2) + np.eye(len(bodies))
    return bool(outside.all() and min(distance.min(), between.min() / 2) >= _CLEAR)
