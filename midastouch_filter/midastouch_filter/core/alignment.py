"""Alignment of a sensor pose to the penetration map it feels: Gauss-Newton on the pose's own rendered view.

The codebook tells poses apart by a few millimetres. The measured map M tells more: for a pose x the renderer gives the
map R(x) that should be felt, and the residual M - R(x) over the pixels, weighed robustly, gives a gradient and an
information matrix in all six directions (point-to-plane registration with projective correspondences, Chen and
Medioni 1992). Directions that the contact does not constrain (sliding on a plane, turning on a ball) keep their prior.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import midastouch_kernels as kernels
from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_model import SensorModel

from .noise_model import NoiseModel

_MARGIN = 1e-3  # m below the gel within which surface that is about to touch is seen


@dataclass(frozen=True)
class Aligned:
    """A Gaussian over poses after the penetration map was taken into account.

    pose (4, 4) `T_obj_gel`; covariance (6, 6) of [translation, rotation] in the pose's own frame, m and rad;
    log_evidence, how well the map fits the prior Gaussian, relative to other Gaussians for the same map;
    fit, share in [0, 1] of the touched pixels that the pose explains (0 if nothing is touched).
    """

    pose: np.ndarray
    covariance: np.ndarray
    log_evidence: float
    fit: float


class PenetrationAlignment:
    """Aligns poses on one mesh.

    Args: mesh; sensor, at the resolution of the penetration maps; noise.
    Attributes: sensor; map_shape, rows and columns of the maps.
    """

    def __init__(self, mesh: ObjectMesh, sensor: SensorModel, noise: NoiseModel):
        self.sensor, self.map_shape = sensor, sensor.gel_depth.shape
        self._renderer = PenetrationRenderer(mesh, sensor, _MARGIN)
        self._kernel = kernels.MapAlignment(
            self._renderer.scene,
            *sensor.rays,
            sensor.gel_depth,
            sensor.pixel_area / noise.map_correlation**2 / noise.map_noise**2,
        )

    def render(self, poses: np.ndarray) -> np.ndarray:
        """Penetration maps (N, H, W) m that are felt at poses (N, 4, 4)."""
        return np.maximum(self._renderer.render(poses), 0.0)

    def align(
        self, pose: np.ndarray, covariance: np.ndarray, penetration: np.ndarray, start: np.ndarray | None = None
    ) -> Aligned:
        """Posterior of the prior N(pose (4, 4), covariance (6, 6), pose's own frame) given a penetration map (H, W) m.

        The optimum is looked for from `start` (4, 4), by default the prior's pose.
        """
        pose = np.ascontiguousarray(pose, float)
        start = pose if start is None else np.ascontiguousarray(start, float)
        found, posterior, log_evidence, fit = self._kernel.align(pose, covariance, penetration, start)
        return Aligned(found, posterior, log_evidence, fit)


def without_jitter(
    pose: np.ndarray, prior: np.ndarray, jitter: np.ndarray, posterior: Aligned
) -> tuple[np.ndarray, np.ndarray]:
    """Mean (4, 4) and covariance (6, 6) of the mode, given the posterior of mode plus this frame's jitter.

    An arm reports each pose with an error of its own that does not stay: the penetration sees the sum of both, and only
    the mode's share of the innovation may move the particles for good (conditioning of a joint Gaussian).
    """
    total = prior + jitter
    gain = np.linalg.solve(total, prior).T
    offset = gain @ se3.log(se3.inverse(pose) @ posterior.pose)
    covariance = prior - gain @ (total - posterior.covariance) @ gain.T
    return pose @ se3.exp(offset), 0.5 * (covariance + covariance.T)
