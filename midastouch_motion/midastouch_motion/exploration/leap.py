"""Leaps, as plans of acts: off the surface, through the air, and down elsewhere.

A way (N, 4, 4) holds the gel poses T_base_gel on the surface that a leap passes over; at the last of them it touches.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence

import numpy as np

from midastouch_common import se3

from .acts import Approach, Lift, Plan, Touch
from .surroundings import SurfaceTrack, Surroundings

CLEARANCES = 12e-3, 30e-3, 72e-3
"""m above the surface; the next one if something is in the way. The filter takes less for a gap in a slide."""

SEARCHED = 0.015
"""m below the expected surface that are searched: the estimate may be off."""

_TURN = np.radians(60.0)  # largest turn from pose to pose in the air, so that straight lines lead around the object
_AROUND = 0.013, 0.026, 0.039  # m beyond a position that cannot be touched, where others are tried
_SHORTER = 1.0, 0.5, 0.25  # fractions of a way that are tried if no surface is known


def ways_along(around: Surroundings, heading: float, length: float) -> list[np.ndarray]:
    """Return the way to touch `length` m away, then alternatives in case that fails: longer ways, or shorter ones if
    the surface is not known."""
    if around.mesh is None:
        track = around.track(heading, length)
        return [_over(track, fraction * length) for fraction in _SHORTER]
    track = around.track(heading, length + _AROUND[-1])
    return [_over(track, length), *(_over(track, length + on) for on in _AROUND if length + on < track.gone[-1])]


def ways_to(around: Surroundings, position: np.ndarray) -> list[np.ndarray]:
    """Return the way to a position (3,) m of the base frame, then alternatives that end on the way back from it."""
    there = around.over(position)
    track = around.towards(position, 2 * float(np.linalg.norm(there[:3, 3] - around.gel[:3, 3])))
    nearest = int(np.argmin(np.linalg.norm(track.poses[:, :3, 3] - there[:3, 3], axis=1)))
    before = _over(track, track.gone[nearest])[:-1]
    back = Surroundings(there, around.object, around.mesh).towards(around.gel[:3, 3], _AROUND[-1])
    ends = [there, *(back.at(length) for length in _AROUND[:-1])]
    return [np.concatenate([before, end[None]]) for end in ends]


def leap(ways: Sequence[np.ndarray], searched: float = SEARCHED) -> Plan[bool]:
    """Lift, fly along the first possible way, and touch at its end; return whether it touches there.

    If no way is possible it goes down where it began, unless it cannot get back there. searched: depth [m] below the
    last pose in which it looks for the surface. A flight that led nowhere is retraced, because that path is free.
    """
    height, left = 0.0, [*ways]
    for clearance in CLEARANCES:
        lifted = yield Lift(clearance - height)
        if not lifted.success:
            break
        height = clearance
        while left:
            passed = yield from _fly(left[0] @ se3.translation([0.0, 0.0, clearance]))
            through = len(passed) == len(left[0])
            if through and (yield from _down(left[0][-1], clearance, searched)):
                return True
            back = [*reversed(passed), lifted.pose]
            if len((yield from _fly(back))) < len(back):
                return False  # no descent is planned where it is now
            if not through:  # try higher up: the other ways pass the same obstacle
                break
            del left[0]
        if not left:
            break
    yield from _down(lifted.pose @ se3.translation([0.0, 0.0, -height]), height, SEARCHED)
    return False


def _down(pose: np.ndarray, height: float, searched: float) -> Plan[bool]:
    """Go down from `height` m above a pose (4, 4) to at most `searched` m below it; return whether it touches then.

    A touch is slow, so it approaches through the air, down to the lowest clearance or to an obstacle.
    """
    if height > CLEARANCES[0]:
        came = yield Approach(pose @ se3.translation([0.0, 0.0, CLEARANCES[0]]))
        height = max(float((se3.inverse(pose) @ came.pose)[2, 3]), 0.0)
    return (yield Touch(height + searched)).touching


def _fly(poses: Iterable[np.ndarray]) -> Plan[list[np.ndarray]]:
    """Fly from pose to pose (4, 4) until something is in the way; return the poses reached."""
    passed = []
    for pose in poses:
        if not (over := (yield Approach(pose))).success:
            break
        passed.append(over.pose)
    return passed


def _over(track: SurfaceTrack, length: float) -> np.ndarray:
    """Return the way (N, 4, 4) along a track up to `length` m, with as few poses as lead around the object."""
    poses = track.poses[: track.index(length) + 1]
    kept = [poses[0]]
    for before, pose in itertools.pairwise(poses):
        if np.arccos(np.clip(kept[-1][:3, 2] @ pose[:3, 2], -1, 1)) > _TURN:  # between the z axes
            kept.append(before)
    return np.stack([*kept[1:], poses[-1]])
