"""Alignment of a sensor pose to measured penetration maps: Gauss-Newton on the pose's own rendered view.

The codebook distinguishes poses a few millimetres apart. The measured map M is more precise: for a pose x the renderer
gives the map R(x) that should be measured, and the residual M - R(x) over the pixels, weighed robustly, gives a
gradient and an information matrix in all six directions (point-to-plane registration with projective correspondences,
Chen and Medioni 1992). Directions that the contact does not constrain (sliding on a plane, turning on a ball) keep
their prior.

Several fingers of one frame are a sequential Bayesian update, finger by finger: the belief about the first gel, a
Gaussian, is transformed to the next finger's gel by the adjoint of the transform between them, aligned to that finger's
map, and transformed back. An arm reports each pose with an error that does not last. A map sees the sum of this error
and the hypothesis' own, and only the hypothesis' part of the innovation moves it for good. The part of a map that stays
unexplained gives the size of its noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

import midastouch_kernels as kernels
from midastouch_common.mesh import ObjectMesh
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_model import SensorModel

from .noise_model import NoiseModel
from .touch import Measurement, gels_of

_MARGIN = 1e-3  # m: surface that is about to touch is rendered up to this far below the gel
_MOST_DESCENTS = 4


@dataclass(frozen=True)
class Aligned:
    """A Gaussian over poses after the penetration map was taken into account.

    pose (4, 4) `T_obj_gel`; covariance (6, 6) of [translation, rotation] in the pose's own frame, m and rad;
    fit, fraction in [0, 1] of the touched pixels that the pose explains (0 if nothing is touched).
    """

    pose: np.ndarray
    covariance: np.ndarray
    fit: float


@dataclass(frozen=True)
class Sighting:
    """Pose at which one frame's maps see a hypothesis, including that frame's error of the arm.

    pose (4, 4) `T_obj_gel`; covariance (6, 6) in the pose's own frame; fit, fraction of the maps that it explains.
    """

    pose: np.ndarray
    covariance: np.ndarray
    fit: float


@dataclass(frozen=True)
class Alignments:
    """Result of aligning P hypotheses to penetration maps.

    poses (P, 4, 4) and covariances (P, 6, 6): without this frame's error of the measured pose, unchanged if too
    little is explained; fits (P, F), fraction of each of F maps that is explained; seen (P, 4, 4) and seen_covariances
    (P, 6, 6): the pose in this very frame; descents (P,), their number.
    """

    poses: np.ndarray
    covariances: np.ndarray
    fits: np.ndarray
    seen: np.ndarray
    seen_covariances: np.ndarray
    descents: np.ndarray

    def sightings(self) -> list[Sighting]:
        """Return each hypothesis as this frame's maps see it."""
        return [Sighting(*each) for each in zip(self.seen, self.seen_covariances, self.fits.min(axis=1), strict=True)]


class PenetrationAlignment:
    """Alignment of poses on one mesh.

    Args: mesh; sensor, at the resolution of the penetration maps; noise.
    Attributes: sensor; map_shape, rows and columns of the maps.
    """

    def __init__(self, mesh: ObjectMesh, sensor: SensorModel, noise: NoiseModel):
        self.sensor, self.map_shape = sensor, sensor.gel_depth.shape
        self._renderer = PenetrationRenderer(mesh, sensor, _MARGIN)
        information = sensor.pixel_area / noise.map_correlation**2 / noise.map_noise**2
        self._kernel = kernels.MapAlignment(
            self._renderer.scene, *sensor.rays, sensor.gel_depth, information, noise.elsewhere
        )
        self._noise = noise

    def render(self, poses: np.ndarray) -> np.ndarray:
        """Return the penetration maps (N, H, W) [m] that a sensor measures at poses (N, 4, 4)."""
        return np.maximum(self._renderer.render(poses), 0.0)

    def align(self, pose: np.ndarray, covariance: np.ndarray, penetration: np.ndarray) -> Aligned:
        """Return the posterior of a prior N(pose (4, 4), covariance (6, 6), own frame), given a penetration map (H, W),
        in metres."""
        pose = np.ascontiguousarray(pose, float)
        return Aligned(*self._kernel.align(pose, covariance, penetration, pose))

    def align_each(
        self,
        poses: np.ndarray,
        covariances: np.ndarray,
        touches: Sequence[Measurement],
        needed: np.ndarray | None = None,
        descents: int = _MOST_DESCENTS,
        seeds: bool = False,
    ) -> Alignments:
        """Align P hypotheses N(poses (P, 4, 4), covariances (P, 6, 6), own frames) of the first gel to the maps of all
        touches, one finger after the other, on all cores.

        needed (P,): a hypothesis that cannot explain this fraction of the maps does not matter, and is given up.
        descents: the most per hypothesis. seeds: the hypotheses are only starting points and need not hold the pose.
        """
        noise = self._noise
        return Alignments(
            *self._kernel.align_each(
                np.ascontiguousarray(poses),
                np.ascontiguousarray(covariances),
                np.ascontiguousarray([touch.penetration for touch in touches], np.float32),
                gels_of(touches),
                noise.jitter,
                noise.finger_error,
                np.zeros(len(poses)) if needed is None else needed,
                descents,
                seeds,
                noise.explained,
                noise.map_patches,
                noise.residual_floor,
            )
        )


def transform_covariance(covariance: np.ndarray, motion: np.ndarray) -> np.ndarray:
    """Return the covariance in a pose's own frame after that frame has moved.

    Parameters
    ----------
    covariance : (..., 6, 6)
    motion : (4, 4)

    Returns
    -------
    (..., 6, 6)
    """
    flat = np.ascontiguousarray(covariance).reshape(-1, 6, 6)
    return kernels.transform_covariances(flat, np.ascontiguousarray(motion)).reshape(covariance.shape)
