"""Alignment of a sensor pose to the relief it feels: Gauss-Newton on the pose's own rendered view.

The codebook tells poses apart by a few millimetres. The measured relief tells more: for a pose x the renderer gives
the relief R(x) that should be felt, and the residual M - R(x) over the pixels, weighed robustly, gives a gradient and
an information matrix in all six directions (point-to-plane registration with projective correspondences, Chen and
Medioni 1992). Directions that the contact does not constrain (sliding on a plane, turning on a ball) keep their prior.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from midastouch_perception import se3
from midastouch_perception.mesh import ObjectMesh
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.simulation.renderer import PenetrationRenderer, draw_share

from . import tangent
from .lookup import ROTATION_SCALE

_MARGIN = 1e-3  # m below the gel within which surface that is about to touch is seen
# m, residual at which a pixel's weight has halved (Geman and McClure 1987), iteration by iteration: wide first, so that
# a start a millimetre off is not all outliers (graduated non-convexity, Blake and Zisserman 1987)
_OUTLIER = (2e-3, 2e-3, 1e-3, 1e-3, 5e-4, 5e-4, 3e-4, 3e-4)
_SMALL_STEP = 5e-5, 2e-3  # m, rad: no second iteration at the same width after one this small
_NEAR = 0.9  # fit at a width, beyond which a second iteration at the same tells no more
# Between places a relief counts as if its error were half as large again: what it mistakes looks like another place
_BETWEEN_PLACES = 1 / 1.5**2
_STEEPEST = 3.0  # slope beyond which a finite difference across a silhouette says nothing


@dataclass(frozen=True)
class Aligned:
    """A Gaussian over poses after the relief was taken into account.

    pose (4, 4) `T_obj_gel`; covariance (6, 6) of [translation, rotation] in the pose's own frame, m and rad;
    log_evidence, how well the relief fits the prior Gaussian, relative to other Gaussians for the same relief;
    fit, share in [0, 1] of the touched pixels that the pose explains (0 if nothing is touched).
    """

    pose: np.ndarray
    covariance: np.ndarray
    log_evidence: float
    fit: float


class ReliefAlignment:
    """Aligns poses on one mesh.

    Args: mesh; sensor, at the resolution of the reliefs; noise [m], standard deviation of a relief's error;
    correlation [m], over which that error is one and the same.
    """

    def __init__(self, mesh: ObjectMesh, sensor: SensorModel, noise: float, correlation: float):
        self.sensor = sensor
        self._scene = PenetrationRenderer(mesh, sensor, _MARGIN).scene
        self._tangents = tuple(np.ascontiguousarray(t) for t in sensor.rays)
        self._gel_depth = sensor.gel_depth
        self._information = sensor.pixel_area / correlation**2 / noise**2

    def align(
        self, pose: np.ndarray, covariance: np.ndarray, relief: np.ndarray, start: np.ndarray | None = None
    ) -> Aligned:
        """Posterior of the prior N(pose (4, 4), covariance (6, 6), pose's own frame) given a relief (H, W) m.

        The optimum is looked for from `start` (4, 4), by default the prior's pose.
        """
        prior = np.linalg.inv(covariance)
        pose = np.ascontiguousarray(pose, float)
        state, offset, hessian, cost, fit = _descend(
            pose, np.ascontiguousarray(pose if start is None else start, float), prior, relief, self._information,
            _OUTLIER, _first_width(covariance), self._scene, self._tangents, self._gel_depth, self.sensor.gel_distance,
        )  # fmt: skip
        posterior = prior + hessian
        log_evidence = (-0.5 * _BETWEEN_PLACES) * (
            cost + offset @ prior @ offset + np.linalg.slogdet(posterior)[1] - np.linalg.slogdet(prior)[1]
        )
        return Aligned(state, np.linalg.inv(posterior), float(log_evidence), fit)


def _first_width(covariance: np.ndarray) -> int:
    """The first of `_OUTLIER` that is needed: residuals are hardly larger than a prior's (6, 6) spread."""
    spread = np.sqrt(np.trace(covariance[:3, :3]) + ROTATION_SCALE**2 * np.trace(covariance[3:, 3:]))
    return max((k for k in range(0, len(_OUTLIER), 2) if _OUTLIER[k] >= spread), default=0)


def without_jitter(
    pose: np.ndarray, prior: np.ndarray, jitter: np.ndarray, posterior: Aligned
) -> tuple[np.ndarray, np.ndarray]:
    """Mean (4, 4) and covariance (6, 6) of the mode, given the posterior of mode plus this frame's jitter.

    An arm reports each pose with an error of its own that does not stay: the relief sees the sum of both, and only
    the mode's share of the innovation may move the particles for good (conditioning of a joint Gaussian).
    """
    total = prior + jitter
    gain = np.linalg.solve(total, prior).T
    offset = gain @ se3.log(se3.inverse(pose) @ posterior.pose)
    covariance = prior - gain @ (total - posterior.covariance) @ gain.T
    return pose @ se3.exp(offset), 0.5 * (covariance + covariance.T)


@numba.njit(cache=True, nogil=True)
def _descend(pose, start, prior, relief, information, widths, first, scene, tangents, gel_depth, distance):
    """Gauss-Newton from `start`; the last state, its offset (6,) from `pose`, and the normal equations there."""
    state, offset = start.copy(), tangent.log(tangent.inverse(pose) @ start)
    settled = np.inf
    poses = np.empty((1, 4, 4))
    rendered = np.empty((1, *relief.shape), np.float32)
    faces = np.empty((1, 0, 0), np.int32)
    for k in range(first, len(widths) + 1):
        last = k == len(widths)
        outlier = widths[-1] if last else widths[k]
        if outlier == settled and not last:
            continue
        poses[0] = state
        rendered[:] = 0
        draw_share(0, 1, poses, *scene, False, rendered, faces)
        hessian, gradient, cost, fit = _accumulate(
            rendered[0], relief, tangents[0], tangents[1], gel_depth, distance, _MARGIN, outlier
        )
        if fit > _NEAR and not last:
            settled = outlier
        hessian *= information
        gradient *= information
        if last:
            break
        step = np.linalg.solve(prior + hessian, gradient - prior @ offset)
        state = state @ tangent.exp(step)
        offset = tangent.log(tangent.inverse(pose) @ state)
        if np.abs(step[:3]).max() < _SMALL_STEP[0] and np.abs(step[3:]).max() < _SMALL_STEP[1]:
            settled = outlier
    return state, offset, hessian, information * cost, fit


@numba.njit(cache=True, nogil=True)
def _accumulate(rendered, relief, tangent_x, tangent_y, gel_depth, distance, margin, outlier):
    """Robust normal equations of relief - rendered in the pose's tangent space [rho, omega], cost and fit.

    `rendered` counts from `margin` below the gel.
    """
    height, width = rendered.shape
    hessian, gradient, cost = np.zeros((6, 6)), np.zeros(6), 0.0
    explained, touched = 0.0, 0
    jacobian = np.empty(6)
    nothing = -0.999 * margin
    for v in range(1, height - 1):
        for u in range(1, width - 1):
            here, felt = rendered[v, u] - margin, relief[v, u]
            if felt <= 0.0 and here <= 0.0:
                continue  # nothing felt, nothing expected
            residual = felt - here
            weight = 1.0 / (1.0 + (residual / outlier) ** 2)
            cost += weight * residual * residual
            explained += weight
            touched += 1
            left, right = rendered[v, u - 1] - margin, rendered[v, u + 1] - margin
            above, below = rendered[v - 1, u] - margin, rendered[v + 1, u] - margin
            if min(here, left, right, above, below) <= nothing:
                continue  # no surface to take a slope from
            d = gel_depth[v, u] - here
            dl, dr = gel_depth[v, u - 1] - left, gel_depth[v, u + 1] - right
            da, db = gel_depth[v - 1, u] - above, gel_depth[v + 1, u] - below
            # surface tangents along the image's columns and rows, gel frame
            ax = tangent_x[v, u + 1] * dr - tangent_x[v, u - 1] * dl
            ay = tangent_y[v, u + 1] * dr - tangent_y[v, u - 1] * dl
            az = dl - dr
            bx = tangent_x[v - 1, u] * da - tangent_x[v + 1, u] * db
            by = tangent_y[v - 1, u] * da - tangent_y[v + 1, u] * db
            bz = db - da
            if abs(az) > _STEEPEST * abs(ax) or abs(bz) > _STEEPEST * abs(by):
                continue
            nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
            towards = nx * tangent_x[v, u] + ny * tangent_y[v, u] - nz
            if towards >= 0.0:
                continue
            px, py, pz = tangent_x[v, u] * d, tangent_y[v, u] * d, distance - d
            jacobian[0], jacobian[1], jacobian[2] = nx, ny, nz
            jacobian[3] = py * nz - pz * ny
            jacobian[4] = pz * nx - px * nz
            jacobian[5] = px * ny - py * nx
            # Geman-McClure's influence
            pull = weight * weight
            for i in range(6):
                gradient[i] += pull * residual * jacobian[i] / towards
                for j in range(i + 1):
                    hessian[i, j] += pull * jacobian[i] * jacobian[j] / (towards * towards)
    for i in range(6):
        for j in range(i):
            hessian[j, i] = hessian[i, j]
    return hessian, gradient, cost, explained / max(touched, 1)
