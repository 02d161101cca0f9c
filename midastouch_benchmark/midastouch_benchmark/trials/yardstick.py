"""Yardstick of a right pose: the one definition by which every trial judges its poses and modes."""

from __future__ import annotations

import dataclasses

import numpy as np

from midastouch_common.mesh import ObjectMesh
from midastouch_common.pose_metric import pose_errors
from midastouch_perception.symmetry.group import Symmetry

DISTANCE, SHARE, ANGLE = 0.01, 0.1, np.radians(20.0)
"""Largest errors of a right pose, which meets all three: m, fraction of the object's diagonal, rad. A hand misses a nut
sooner than a drill, and it does not find the handle of a mug that is turned."""


@dataclasses.dataclass(frozen=True)
class Yardstick:
    """Limits of a right pose. symmetry: motions that no touch can detect; of the poses equivalent under it, the one
    nearest to the truth counts, as in BOP's MSSD (Hodan et al. 2020). distance: largest error [m]."""

    symmetry: Symmetry = dataclasses.field(default_factory=Symmetry)
    distance: float = DISTANCE

    @classmethod
    def of(cls, mesh: ObjectMesh, symmetry: Symmetry) -> Yardstick:
        """Return the yardstick of an object of known symmetry."""
        return cls(symmetry, min(DISTANCE, SHARE * mesh.diagonal))

    def counted(self, poses: np.ndarray, truth: np.ndarray) -> np.ndarray:
        """Return, for each of poses (N, 4, 4), the equivalent pose that is compared with the truth (4, 4)."""
        return self.symmetry.nearest(poses, truth) if len(poses) else poses

    def right(self, poses: np.ndarray, truth: np.ndarray) -> np.ndarray:
        """Return which (N,) of poses (N, 4, 4) are right; none are if there is no truth (nan)."""
        distance, angle = pose_errors(self.counted(poses, truth), truth)
        return (distance <= self.distance) & (angle <= ANGLE)

    def describe(self) -> dict[str, float]:
        """Return the limits for the JSON of a trial."""
        return {"right_m": self.distance, "right_deg": float(np.degrees(ANGLE))}
