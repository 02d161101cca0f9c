"""Surroundings of a gel, as far as they are known, and tracks along the surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh
from midastouch_common.surface_walk import MIN_PROGRESS, carried, straight_on

_STEP = 4e-3  # m


@dataclass(frozen=True)
class SurfaceTrack:
    """Track that begins with a heading [rad] in the gel's plane; poses: gel poses T_base_gel (N, 4, 4) flat on the
    surface; gone (N,) m: distance of each pose along the track."""

    heading: float
    poses: np.ndarray
    gone: np.ndarray

    def index(self, length: float) -> int:
        """Index of the first pose that is `length` m or more along the track, or of the last one."""
        return min(int(np.searchsorted(self.gone, length - 1e-9)), len(self.gone) - 1)

    def at(self, length: float) -> np.ndarray:
        """Pose (4, 4) of that index."""
        return self.poses[self.index(length)]


@dataclass(frozen=True)
class Surroundings:
    """Gel T_base_gel (4, 4), and object T_base_obj (4, 4) with its mesh, both None if the object is not known."""

    gel: np.ndarray
    object: np.ndarray | None = None
    mesh: ObjectMesh | None = None

    def track(self, heading: float, length: float) -> SurfaceTrack:
        """Return the track in a direction, whose first pose is where the gel is now.

        It follows the surface as far as that continues, or is straight in the gel's plane if no surface is known.

        Parameters
        ----------
        heading : [rad] in the gel's plane
        length : [m]
        """
        if self.mesh is not None:
            return self._geodesic(heading, length)
        gone = np.append(np.arange(0.0, length, _STEP), length)
        along = np.outer(gone, (np.cos(heading), np.sin(heading), 0.0))
        return SurfaceTrack(heading, self.gel @ se3.translation(along), gone)

    def towards(self, goal: np.ndarray, length: float) -> SurfaceTrack:
        """Return the track that begins in the direction of a position.

        Parameters
        ----------
        goal : (3,) in the base frame [m]
        length : [m]
        """
        x, y, _ = self._flat(self.gel)[:3, :3].T @ (goal - self.gel[:3, 3])
        return self.track(float(np.arctan2(y, x)), length)

    def over(self, position: np.ndarray) -> np.ndarray:
        """Return the gel's pose (4, 4) flat on the surface next to a position (3,) m of the base frame, turned the
        shortest way from its present orientation; if no surface is known, at the position and not turned."""
        return self._flat(se3.make(self.gel[:3, :3], position))

    def _flat(self, pose: np.ndarray) -> np.ndarray:
        """Lay a pose T_base_gel (4, 4) flat onto the nearest point of the surface, if one is known."""
        if self.mesh is None:
            return pose
        on_object = se3.inverse(self.object) @ pose
        (point,), _, _ = self.mesh.closest_points(on_object[None, :3, 3])
        (normal,) = self.mesh.smooth_normals(point[None])
        return self.object @ se3.make(carried(on_object[:3, :3], normal), point)

    def _geodesic(self, heading: float, length: float) -> SurfaceTrack:
        here = se3.inverse(self.object) @ self._flat(self.gel)
        frame, point = here[:3, :3], here[:3, 3]
        direction = frame @ (np.cos(heading), np.sin(heading), 0.0)
        poses, gone = [here], [0.0]
        while (left := length - gone[-1]) > _STEP / 100:
            ahead = straight_on(self.mesh, point, direction, step := min(_STEP, left))
            if ahead.moved < MIN_PROGRESS * step:
                break
            frame, point, direction = carried(frame, ahead.normal), ahead.point, ahead.heading
            poses.append(se3.make(frame, point))
            gone.append(gone[-1] + ahead.moved)
        return SurfaceTrack(heading, self.object @ np.stack(poses), np.array(gone))
