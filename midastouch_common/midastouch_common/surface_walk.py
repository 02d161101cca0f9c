"""Walks over a surface along straightest geodesics, step by step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import se3
from .mesh import ObjectMesh

MIN_PROGRESS = 0.3
"""Least progress, as a fraction of a step: at a fold or rim the closest point can be where the sensor already is."""


@dataclass(frozen=True)
class Ahead:
    """End of a step: point (3,) m on the surface, its normal (3,), heading (3,) unit from there on, and the distance
    `moved` [m] from the start."""

    point: np.ndarray
    normal: np.ndarray
    heading: np.ndarray
    moved: float


def straight_on(mesh: ObjectMesh, point: np.ndarray, heading: np.ndarray, step: float) -> Ahead:
    """Take a step of about `step` m from a surface point (3,) in direction `heading` (3,), on a straightest geodesic.

    If the step leads nowhere, the new heading is zero.
    """
    (ahead,), _, _ = mesh.closest_points((point + step * heading)[None])
    (normal,) = mesh.smooth_normals(ahead[None])
    moved = ahead - point
    tangent = moved - (moved @ normal) * normal
    return Ahead(ahead, normal, tangent / max(np.linalg.norm(tangent), 1e-12), float(np.linalg.norm(moved)))


def carried(frame: np.ndarray, normal: np.ndarray, most: float = np.pi) -> np.ndarray:
    """Return a frame (3, 3) turned the shortest way, by at most `most` rad, to bring its z axis to the normal (3,)."""
    axis = np.cross(frame[:, 2], normal)
    sine, cosine = np.linalg.norm(axis), frame[:, 2] @ normal
    # to the opposite direction every way is the shortest
    axis = axis / sine if sine > 1e-9 else frame[:, 0]
    return se3.exp(np.concatenate([np.zeros(3), min(np.arctan2(sine, cosine), most) * axis]))[:3, :3] @ frame
