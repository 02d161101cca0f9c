"""Alignment of a sensor pose to measured penetration maps: Gauss-Newton on the pose's own rendered view.

The codebook tells poses apart by a few millimetres. The measured map M tells more: for a pose x the renderer gives the
map R(x) that should be measured, and the residual M - R(x) over the pixels, weighed robustly, gives a gradient and an
information matrix in all six directions (point-to-plane registration with projective correspondences, Chen and
Medioni 1992). Directions that the contact does not constrain (sliding on a plane, turning on a ball) keep their prior.

Several fingers of one frame are a sequential Bayesian update, finger by finger: the belief about the first gel, a
Gaussian, is transformed to the next finger's gel by the adjoint of the transform between them, aligned to that finger's
map, and transformed back.

The Gaussian posterior is only as wide as its model of the noise has it: `CredibleRegion` says how wide a region is that
holds the truth as often as it claims.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

import midastouch_kernels as kernels
from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_model import SensorModel

from .noise_model import NoiseModel
from .touch import Measurement

_MARGIN = 1e-3  # m below the gel within which surface that is about to touch is seen
WIDTH, WHITE = 24.5, 0.25  # factor on the covariance, by residual ratio and bias; what is added to the latter
_AVERAGED_MAPS, _BIAS_MAPS = 15, 50  # maps over which innovations are averaged, and over which a bias is forgotten
_MORE, _EXPLAINED, _MOST_DESCENTS = 0.01, 0.9, 4  # fractions of a map: less is no gain, no more is needed; descents
LEAST_GAIN = 0.1
"""Fraction of an axis' prior variance that a map must take away to say anything of it."""


@dataclass(frozen=True)
class Aligned:
    """A Gaussian over poses after the penetration map was taken into account.

    pose (4, 4) `T_obj_gel`; covariance (6, 6) of [translation, rotation] in the pose's own frame, m and rad;
    log_evidence, how well the map fits the prior Gaussian, relative to other Gaussians for the same map;
    fit, fraction in [0, 1] of the touched pixels that the pose explains (0 if nothing is touched).
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
        information = sensor.pixel_area / noise.map_correlation**2 / noise.map_noise**2
        self._kernel = kernels.MapAlignment(
            self._renderer.scene, *sensor.rays, sensor.gel_depth, information, noise.elsewhere
        )
        self._pixel = 0.5 * information * self._kernel.width**2  # nats of a touched pixel that is not explained at all

    def render(self, poses: np.ndarray) -> np.ndarray:
        """Penetration maps (N, H, W) m that are measured at poses (N, 4, 4)."""
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

    def of_unknown_scale(
        self,
        pose: np.ndarray,
        covariance: np.ndarray,
        maps: Sequence[Measurement],
        posterior: Aligned,
        evidence_slope: float,
    ) -> Aligned:
        """The posterior of the prior N(pose (4, 4), covariance (6, 6), own frame) with maps whose noise is as large as
        what they leave unexplained says.

        Near the optimum the alignment's log-likelihood falls in proportion to the residual ratio, and so does that of
        an error of unknown scale (docs/internals.md), by `evidence_slope` nats: the ratio of both is the factor on the
        information of the maps.
        """
        touched = sum(np.count_nonzero(each.penetration > 0) for each in maps)
        factor = evidence_slope / (self._pixel * max(touched, 1))
        if factor >= 1.0:
            return posterior
        pose, covariance = kernels.weaken(pose, covariance, posterior.pose, posterior.covariance, factor)
        return replace(posterior, pose=pose, covariance=covariance)


def without_jitter(
    pose: np.ndarray, prior: np.ndarray, jitter: np.ndarray, posterior: Aligned
) -> tuple[np.ndarray, np.ndarray]:
    """Mean (4, 4) and covariance (6, 6) of the mode, given the posterior of mode plus this frame's jitter.

    An arm reports each pose with an error of its own that does not stay: the penetration sees the sum of both, and only
    the mode's part of the innovation may move the particles for good (conditioning of a joint Gaussian).
    """
    return kernels.condition(pose, prior, jitter, posterior.pose, posterior.covariance)


def align_in_turn(
    alignment: PenetrationAlignment,
    pose: np.ndarray,
    covariance: np.ndarray,
    touches: Sequence[Measurement],
    finger_error: np.ndarray,
    start: np.ndarray | None = None,
) -> Aligned:
    """Posterior of the first finger's prior N(pose (4, 4), covariance (6, 6), own frame) given all maps of a frame.

    finger_error (6, 6): covariance of a further finger's pose, given the first one's. start (4, 4): where the first
    optimum is looked for from. The evidence is the sum of the fingers'; the fit that of the finger which fits worst:
    the pose must explain all of them.
    """
    log_evidence, fit = 0.0, 1.0
    for touch in touches:
        penetration, T_gel_finger = touch.penetration, touch.T_gel_finger
        if T_gel_finger is None:
            found = alignment.align(pose, covariance, penetration, start)
            pose, covariance = found.pose, found.covariance
        else:
            there, prior = pose @ T_gel_finger, transform_covariance(covariance, T_gel_finger)
            start = None if start is None else start @ T_gel_finger
            found = alignment.align(there, prior + finger_error, penetration, start)
            mean, posterior = without_jitter(there, prior, finger_error, found)
            back = se3.inverse(T_gel_finger)
            pose, covariance = mean @ back, transform_covariance(posterior, back)
        start = None
        log_evidence += found.log_evidence
        fit = min(fit, found.fit)
    return Aligned(pose, covariance, log_evidence, fit)


def align_until_settled(
    alignment: PenetrationAlignment,
    pose: np.ndarray,
    covariance: np.ndarray,
    touches: Sequence[Measurement],
    finger_error: np.ndarray,
    start: np.ndarray | None = None,
) -> tuple[Aligned, int]:
    """As `align_in_turn`, from where it ended as long as that explains more of the maps; and how often.

    One descent stops short where a start is some millimetres and a sharp edge away.
    """
    found = align_in_turn(alignment, pose, covariance, touches, finger_error, start)
    for count in range(1, _MOST_DESCENTS):
        if found.fit > _EXPLAINED:
            return found, count
        again = align_in_turn(alignment, pose, covariance, touches, finger_error, start=found.pose)
        if again.fit < found.fit + _MORE:
            return found, count + 1
        found = again
    return found, _MOST_DESCENTS


def transform_covariance(covariance: np.ndarray, motion: np.ndarray) -> np.ndarray:
    """Covariance (..., 6, 6) of a pose's own frame after the frame went on by `motion` (4, 4)."""
    flat = np.ascontiguousarray(covariance).reshape(-1, 6, 6)
    return kernels.transform_covariances(flat, np.ascontiguousarray(motion)).reshape(covariance.shape)


def adjoint(motion: np.ndarray) -> np.ndarray:
    """(6, 6) that takes a tangent vector of a pose's own frame to the frame that went on by `motion` (4, 4)."""
    back = se3.inverse(motion)
    r, (x, y, z) = back[:3, :3], back[:3, 3]
    out = se3.turn(r)
    out[:3, 3:] = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) @ r
    return out


class CredibleRegion:
    """How much wider than an alignment's own covariance a region is that holds the truth as often as it says.

    Two things tell that the alignment's model of the noise does not hold, and each widens the covariance:

    * What the map leaves unexplained. How wrong a map is differs from touch to touch, so that the likelihood of a pose
      is a power of its residual ratio m (docs/internals.md). The curvature around its peak falls as m + m0, and the
      covariance grows as it.
    * That maps correct the pose in one direction again and again. The innovations of a filter whose model holds are
      white (Mehra 1970). Those of an arm that is late, of an object that was pushed, or of a pose nearby are not: what
      one map corrects, the odometry undoes. The pose lags behind, and in directions that maps tell little of it stays
      off for a while once that is over.

    How wide the result must be is a split-conformal quantile (Vovk et al. 2005), fitted by
    `midastouch_benchmark/fits/regions.py`. `follow` takes the alignments of the dominant mode.

    Args: noise.

    Attribute: bias, squared mean of the last innovations over their predicted variance, times their number, summed over
    the gel's axes: some 3 if they are white and as large as predicted, more if they go on in one direction. The largest
    one is forgotten slowly.
    """

    def __init__(self, noise: NoiseModel):
        self._noise = noise
        self.restart()

    def restart(self) -> None:
        """Forget all corrections: the gel's pose is unknown."""
        self._sum, self._number = np.zeros(6), np.ones(6)
        self.bias = 0.0

    def follow(self, pose: np.ndarray, covariance: np.ndarray, posterior: Aligned) -> None:
        """A map turned the prior N(pose (4, 4), covariance (6, 6), own frame) into the posterior."""
        prior = np.diag(covariance)
        predicted = prior - np.diag(posterior.covariance)
        informed = predicted > LEAST_GAIN * prior
        moved = se3.log(se3.inverse(pose) @ posterior.pose)
        keep = 1.0 - 1.0 / _AVERAGED_MAPS
        self._sum, self._number = keep * self._sum, keep * self._number + informed
        self._sum[informed] += moved[informed] / np.sqrt(predicted[informed])
        self.bias = max((1.0 - 1.0 / _BIAS_MAPS) * self.bias, float((self._sum**2 / self._number).sum()))

    def widening(self, aligned: Aligned) -> float:
        """Factor on the covariance of a pose that was aligned to this frame's maps."""
        return WIDTH * (1.0 - aligned.fit + self._noise.residual_floor) * (WHITE + self.bias) ** 2
