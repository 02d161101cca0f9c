"""Symmetry of an object: the rigid motions that map its surface onto itself.

A can turned about its axis is the same can: if S is a symmetry of the surface, no method can distinguish the sensor's
poses T and S T by touches alone. The symmetry-aware error of a pose is its error after the S that brings it nearest to
the truth.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from midastouch_common import se3
from midastouch_common.pose_metric import ROTATION_SCALE, pose_distance


@dataclass(frozen=True)
class Symmetry:
    """Rigid motions that map a surface onto itself.

    transforms (K, 4, 4): one of each connected family, the identity first. free: "none" if these are all motions,
    "axis" if any turn about `axis` (3,) through `centre` (3,) [m] may follow each, "all" for any turn about `centre`.
    """

    transforms: np.ndarray = field(default_factory=lambda: np.eye(4)[None])
    free: str = "none"
    axis: np.ndarray = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    centre: np.ndarray = field(default_factory=lambda: np.zeros(3))

    @property
    def trivial(self) -> bool:
        """True if the identity is the only motion."""
        return self.free == "none" and len(self.transforms) == 1

    def describe(self) -> str:
        """Return a description for tables."""
        if self.free == "all":
            return "sphere"
        if self.free == "axis":
            return "axis, both ends alike" if len(self.transforms) > 1 else "axis"
        return "none" if self.trivial else f"{len(self.transforms)} poses alike"

    def nearest(self, poses: np.ndarray, truth: np.ndarray) -> np.ndarray:
        """Replace each pose by the equivalent one nearest to the truth.

        Nearest by the distance d^2 = |t - t'|^2 + (2 r sin(angle / 2))^2, r = 10 mm (`ROTATION_SCALE`), for which the
        best turn has a closed form: it maximises tr(R B), B = p g' + r^2/2 P G', over the free turns R.

        Parameters
        ----------
        poses : (N, 4, 4)
        truth : (4, 4)
            If it is unknown (nan), the poses are returned unchanged.

        Returns
        -------
        (N, 4, 4)
        """
        poses = np.asarray(poses, float)
        if self.trivial or not np.isfinite(truth).all():
            return poses
        return self._nearest(poses, truth)

    def distance(self, poses: np.ndarray, truth: np.ndarray) -> np.ndarray:
        """Return the distance of `nearest` between the truth and the equivalents of poses.

        Parameters
        ----------
        poses : (N, 4, 4)
        truth : (4, 4)

        Returns
        -------
        (N,) [m]
        """
        return pose_distance(self._nearest(np.asarray(poses, float), truth), truth)

    def _nearest(self, poses: np.ndarray, truth: np.ndarray) -> np.ndarray:
        """Return the equivalents of poses (N, 4, 4) nearest to the truth (4, 4)."""
        if self.free == "none":
            return self.transforms[self._which(poses, truth)] @ poses
        best, goal = poses, truth[:3, 3] - self.centre
        least: np.ndarray = np.full(len(poses), np.inf)
        for transform in self.transforms:
            moved = transform @ poses
            arm = moved[:, :3, 3] - self.centre
            correlation = arm[:, :, None] * goal + 0.5 * ROTATION_SCALE**2 * moved[:, :3, :3] @ truth[:3, :3].T
            turn = self._best_turn(correlation)
            moved = se3.make(turn @ moved[:, :3, :3], np.einsum("nij,nj->ni", turn, arm) + self.centre)
            distance = pose_distance(moved, truth)
            nearer = distance < least
            best, least = np.where(nearer[:, None, None], moved, best), np.where(nearer, distance, least)
        return best

    def _which(self, poses: np.ndarray, truth: np.ndarray) -> np.ndarray:
        """Return for each pose (N, 4, 4) which of the K motions brings it nearest to the truth (4, 4).

        A ball has hundreds of motions. Their squared distances are linear in the pose but for what is the same for all.
        """
        back = np.swapaxes(self.transforms[:, :3, :3], 1, 2)
        offset = self.transforms[:, :3, 3] - truth[:3, 3]
        position = 2.0 * np.einsum("kij,kj->ki", back, offset)
        rotation = -(ROTATION_SCALE**2) * (back @ truth[:3, :3])
        linear = np.concatenate([position, rotation.reshape(-1, 9)], axis=1)
        columns = np.concatenate([poses[:, :3, 3], poses[:, :3, :3].reshape(-1, 9)], axis=1)
        return np.argmin(columns @ linear.T + np.square(offset).sum(axis=1), axis=1)

    def _best_turn(self, correlation: np.ndarray) -> np.ndarray:
        """Return the free turns (N, 3, 3) that maximise tr(R B) for B (N, 3, 3)."""
        if self.free == "axis":
            u = self.axis
            across = np.einsum("njk,ijk,i->n", correlation, _LEVI_CIVITA, u)
            along = np.trace(correlation, axis1=1, axis2=2) - np.einsum("i,nij,j->n", u, correlation, u)
            return Rotation.from_rotvec(np.arctan2(across, along)[:, None] * u).as_matrix()
        left, _, right = np.linalg.svd(correlation)
        flip = np.ones((len(correlation), 3))
        flip[:, 2] = np.linalg.det(left) * np.linalg.det(right)
        return np.einsum("nji,nj,nkj->nik", right, flip, left)

    def turned(self, count: int) -> np.ndarray:
        """Return motions (K, 4, 4) of the group, the identity first; of free turns about an axis, `count` steps."""
        if self.free != "axis":
            return self.transforms
        angles = np.arange(count) * 2 * np.pi / count
        turns = about(self.centre, Rotation.from_rotvec(angles[:, None] * self.axis).as_matrix())
        return (turns[:, None] @ self.transforms).reshape(-1, 4, 4)

    def as_json(self) -> dict:
        """Return the content that `from_json` reads."""
        return {name: np.asarray(value).tolist() for name, value in vars(self).items()}

    @classmethod
    def from_json(cls, content: dict) -> Symmetry:
        """Restore a symmetry from `as_json`; raises ValueError, KeyError or TypeError for any other content."""
        symmetry = cls(
            np.array(content["transforms"], float).reshape(-1, 4, 4),
            str(content["free"]),
            np.array(content["axis"], float).reshape(3),
            np.array(content["centre"], float).reshape(3),
        )
        numbers = (symmetry.transforms, symmetry.axis, symmetry.centre)
        if symmetry.free not in ("none", "axis", "all") or not all(np.isfinite(each).all() for each in numbers):
            raise ValueError("not the motions of a group")
        return symmetry


def about(centre: np.ndarray, rotations: np.ndarray) -> np.ndarray:
    """Return motions (K, 4, 4) that turn about a point (3,) [m] by rotations (K, 3, 3)."""
    return se3.make(rotations, centre - rotations @ centre)


_LEVI_CIVITA = np.zeros((3, 3, 3))
for _i, _j, _k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
    _LEVI_CIVITA[_i, _j, _k], _LEVI_CIVITA[_i, _k, _j] = 1.0, -1.0
