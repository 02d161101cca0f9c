"""Sensor poses that touch an object and that a finger could reach (paper appendix A)."""

from __future__ import annotations

import dataclasses

import numpy as np

from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh

from ..sensor_model import MAX_PENETRATION, SensorModel
from .renderer import PenetrationRenderer

_TOLERANCE = 1e-4  # m
_PULLS = 4
MAX_EXCESS = 2e-3  # m beyond the wanted penetration; any deeper, the sensor's body would be inside the object


@dataclasses.dataclass(frozen=True)
class ContactSampling:
    """Distribution of contact poses; the defaults are the paper's.

    Attributes: press, range [m] of the wanted penetration; tilt, standard deviation [rad] of the angle between gel and
    surface normal; edge_fraction of the poses on edges sharper than 10 deg; free_fraction of the poses without contact.
    """

    press: tuple[float, float] = (0.5e-3, 2e-3)
    tilt: float = np.radians(5.0)
    edge_fraction: float = 0.3
    free_fraction: float = 0.02


def touch_points(
    mesh: ObjectMesh, n: int, edge_fraction: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Draw points (n, 3) m and outward normals (n, 3), uniform by area; `edge_fraction` on edges, uniform by length."""
    points, normals, _ = mesh.sample_surface(n, rng)
    ends, edge_normals = mesh.feature_edges
    on_edge = np.flatnonzero(rng.random(n) < edge_fraction)
    if len(ends) and len(on_edge):
        length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        edge = rng.choice(len(ends), len(on_edge), p=length / length.sum())
        along = rng.random((len(on_edge), 1))
        points[on_edge] = ends[edge, 0] * (1 - along) + ends[edge, 1] * along
        normals[on_edge] = edge_normals[edge]
    return points, normals


def pose_from_contact(
    points: np.ndarray, normals: np.ndarray, yaw: np.ndarray, tilt: np.ndarray, azimuth: np.ndarray, press: np.ndarray
) -> np.ndarray:
    """Return gel poses T_obj_gel (N, 4, 4): z along the normal, turned by `yaw`, then tilted by `tilt` about the axis
    at `azimuth` in the gel's plane (all (N,) rad), and pushed `press` (N,) m into the surface along the gel's own z."""
    rotation = se3.frame_from_normal(normals, yaw)
    axis = np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros_like(azimuth)], axis=1)
    tilted = rotation @ se3.exp(np.concatenate([np.zeros_like(axis), tilt[:, None] * axis], axis=1))[:, :3, :3]
    return se3.make(tilted, points - press[:, None] * tilted[:, :, 2])


class Reachability:
    """Test of whether poses can be reached, by coarse penetration maps; it also limits their penetration."""

    def __init__(self, mesh: ObjectMesh, sensor: SensorModel):
        self._renderer = PenetrationRenderer(mesh, sensor.scaled(0.25))

    def settle(self, poses: np.ndarray, press: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return poses (N, 4, 4) pulled back to at most 2 mm of penetration, and whether (N,) each is reachable and
        touches."""
        deepest = self.deepest(poses)
        reachable = deepest - press <= MAX_EXCESS
        poses, deepest = self._pulled_back(poses, deepest, np.where(reachable, MAX_PENETRATION, np.inf))
        return poses, reachable & (deepest <= MAX_PENETRATION + _TOLERANCE) & (deepest > _TOLERANCE)

    def pressed(self, poses: np.ndarray, press: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return poses (N, 4, 4) moved along their own axes until their deepest point is `press` (N,) m deep, and (N,)
        whether each is. A pose that starts 2 mm or more off the surface is not."""
        poses = poses @ se3.translation([0.0, 0.0, -MAX_PENETRATION])
        poses, deepest = self._pulled_back(poses, self.deepest(poses), press)
        return poses, (deepest > 0) & (np.abs(deepest - press) <= _TOLERANCE)

    def _pulled_back(self, poses: np.ndarray, deepest: np.ndarray, most: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return poses (N, 4, 4), `deepest` (N,) m deep, pulled out of the object along their own axes where deeper
        than `most` (N,) m, and their new depths."""
        poses = poses.copy()
        # on a flank, pulling back by the excess does not remove all of it, because another point becomes the deepest
        for _ in range(_PULLS):
            deep = np.flatnonzero(deepest > most)
            if not len(deep):
                break
            poses[deep, :3, 3] += (deepest[deep] - most[deep])[:, None] * poses[deep, :3, 2]
            deepest[deep] = self.deepest(poses[deep])
        return poses, deepest

    def free(self, poses: np.ndarray) -> np.ndarray:
        """Return whether (N,) poses (N, 4, 4) touch nothing. (A pose moved away from one wall may be in another.)"""
        return self.deepest(poses) == 0

    def deepest(self, poses: np.ndarray) -> np.ndarray:
        """Return the largest penetration (N,) m at poses (N, 4, 4), 0 in the air."""
        return self._renderer.render(poses).max(axis=(1, 2)).astype(float)


def sample_contact_poses(
    mesh: ObjectMesh,
    n: int,
    rng: np.random.Generator,
    sensor: SensorModel,
    sampling: ContactSampling = ContactSampling(),
) -> np.ndarray:
    """Draw n reachable gel poses T_obj_gel (n, 4, 4) by rejection; `free_fraction` of them hover above the surface."""
    reachability = Reachability(mesh, sensor)
    kept: list[np.ndarray] = []
    missing = n
    while missing > 0:
        m = int(missing * 1.3) + 16
        points, normals = touch_points(mesh, m, sampling.edge_fraction, rng)
        press = rng.uniform(*sampling.press, m)
        yaw, azimuth = rng.uniform(0, 2 * np.pi, (2, m))
        tilt = np.abs(rng.normal(0, sampling.tilt, m))
        poses, reachable = reachability.settle(pose_from_contact(points, normals, yaw, tilt, azimuth, press), press)
        free = np.flatnonzero(rng.random(m) < sampling.free_fraction)
        poses[free, :3, 3] += rng.uniform(2.5e-3, 8e-3, (len(free), 1)) * poses[free, :3, 2]
        reachable[free] &= reachability.free(poses[free])
        kept.append(poses[reachable][:missing])
        missing -= len(kept[-1])
    return np.concatenate(kept)
