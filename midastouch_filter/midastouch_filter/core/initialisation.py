"""Where the particles start (paper section 4.3, "Initialization")."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

import midastouch_kernels as kernels
from midastouch_common import se3
from midastouch_common.errors import InputError

from .fingers import Finger
from .lookup import PoseLookup
from .motion_model import MotionModel, Odometry, transformed
from .particles import Particles
from .pose_hypothesis import PoseHypothesis
from .workers import Workers

_WIDEST = 1e3  # m, rad; what is farther off is a mistake, and float32 loses it


def checked_prior(pose: np.ndarray, sigma_t: float, sigma_r: float) -> np.ndarray:
    """The prior `T_obj_gel` (4, 4), its rotation orthonormal, if a start can be drawn around it.

    Raises InputError if it is no rigid transform, or if it or a sigma [m, rad] is negative, not finite or absurd.
    """
    try:
        motion = Odometry.from_matrix(pose)
    except ValueError as error:
        raise InputError(f"prior pose: {str(error).replace('odometry', 'the pose')}") from error
    if not motion.distance <= _WIDEST:
        raise InputError(f"prior pose: {motion.distance:.3g} m from the object's origin")
    if not (0 <= sigma_t <= _WIDEST and 0 <= sigma_r <= _WIDEST):
        raise InputError(f"prior pose: sigmas {sigma_t:.3g} m, {sigma_r:.3g} rad must lie between 0 and {_WIDEST:g}")
    return motion.transform


def uniform_entries(n_entries: int, n: int, rng: np.random.Generator) -> np.ndarray:
    """n codebook entries (n,), ascending, over the whole surface, which the codebook covers evenly.

    Stratified: no entry is drawn more than once more than another.
    """
    rounds = -(-n // n_entries)
    return np.sort(np.concatenate([rng.permutation(n_entries) for _ in range(rounds)])[:n])


def gaussian_poses(centre: np.ndarray, sigma_t: float, sigma_r: float, n: int, rng: np.random.Generator) -> np.ndarray:
    """n poses (n, 4, 4) around `centre` (4, 4): sigma_t [m] and sigma_r [rad] per axis (paper section 4.3).

    They lie off the surface; the paper then replaces each by the nearest pose of the codebook.
    """
    noise = np.concatenate([sigma_t * rng.standard_normal((n, 3)), sigma_r * rng.standard_normal((n, 3))], axis=1)
    rotations = se3.exp(noise * [0, 0, 0, 1, 1, 1])[:, :3, :3]
    return se3.make(centre[:3, :3] @ rotations, centre[:3, 3] + noise[:, :3])


class ParticleSource:
    """Draws equally weighted particles on the surface of one object.

    Args: lookup; motion_model, which spreads them over the gaps between entries;
    jitter (6, 6), covariance of one measured sensor pose; rng; workers.
    """

    def __init__(
        self,
        lookup: PoseLookup,
        motion_model: MotionModel,
        jitter: np.ndarray,
        rng: np.random.Generator,
        workers: Workers,
    ):
        self._lookup, self._motion_model = lookup, motion_model
        self._jitter, self._rng, self._workers = jitter, rng, workers

    def uniform(self, n: int) -> Particles:
        """n particles over the whole surface, with uniform yaw."""
        return self._around(uniform_entries(len(self._lookup), n, self._rng))

    def gaussian(self, prior: np.ndarray, sigma_t: float, sigma_r: float, n: int) -> Particles:
        """n particles around a prior (4, 4), each at the nearest codebook entry."""
        drawn = gaussian_poses(prior, sigma_t, sigma_r, n, self._rng)
        return self._around(np.sort(self._lookup.exact(drawn)))

    def matches(self, finger: Finger, n: int) -> Particles:
        """n particles drawn by the likelihood of what the finger measures at present."""
        gels = self._around(finger.draw_matches(n, self._rng))
        T_gel_finger = finger.touch.T_gel_finger
        if T_gel_finger is None:
            return gels
        particles = transformed(gels, se3.inverse(T_gel_finger), self._workers)
        self._lookup.relocate(particles)
        return particles

    def inject(self, particles: Particles, finger: Finger, fraction: float) -> int:
        """Replace this fraction of the particles, drawn at random, by matches; returns their number."""
        where = self._rng.choice(len(particles), round(fraction * len(particles)), replace=False)
        particles.replace(where, self.matches(finger, len(where)))
        return len(where)

    def matches_and_uniform(self, finger: Finger, n: int) -> Particles:
        """n particles, half as `matches`, half over the whole surface."""
        uniform = uniform_entries(len(self._lookup), n - n // 2, self._rng)
        return self._around(np.concatenate([uniform, self.matches(finger, n // 2).entries]))

    def hypotheses_and_uniform(self, hypotheses: Sequence[PoseHypothesis], n: int) -> Particles:
        """n particles, half at one or more hypotheses, each by its probability, half over the whole surface."""
        fractions = np.array([hypothesis.probability for hypothesis in hypotheses])
        numbers = np.round(0.5 * n * fractions / fractions.sum()).astype(int)
        some = [self.at(hypothesis, number) for hypothesis, number in zip(hypotheses, numbers, strict=True) if number]
        particles = Particles.joined([*some, self.uniform(n - sum(map(len, some)))])
        particles.log_weights[:] = -np.log(n)
        return particles

    def at(self, hypothesis: PoseHypothesis, n: int) -> Particles:
        """n particles spread as the hypothesis' covariance and the arm's jitter say."""
        return self._spread(hypothesis.pose[None], np.zeros(n, np.int64), hypothesis.covariance + self._jitter)

    def among(self, poses: np.ndarray, scores: np.ndarray, covariance: np.ndarray, n: int) -> Particles:
        """n particles around poses (C, 4, 4), drawn by their log-likelihoods (C,), with covariance (6, 6) each."""
        cumulative = np.cumsum(np.exp(scores - scores.max()))
        index = np.searchsorted(cumulative, self._rng.random(n) * cumulative[-1], side="right").clip(max=len(poses) - 1)
        return self._spread(poses, index, covariance)

    def _spread(self, centres: np.ndarray, index: np.ndarray, covariance: np.ndarray) -> Particles:
        """Normally distributed around centres (C, 4, 4), each around that of its index (n,), with covariance (6, 6) in
        the centre's frame."""
        n, centres = len(index), np.ascontiguousarray(centres)
        axes, variance, _ = np.linalg.svd(covariance)
        factor, normal = axes * np.sqrt(variance), self._rng.standard_normal((n, 6))
        particles = Particles(
            positions=np.empty((n, 3), np.float32),
            quaternions=np.empty((n, 4), np.float32),
            log_weights=np.full(n, -np.log(max(n, 1))),
            entries=np.zeros(n, np.int32),
        )
        self._workers.run(
            n,
            lambda low, high, _: kernels.spread(
                low, high, centres, index, factor, normal, particles.positions, particles.quaternions
            ),
        )
        self._lookup.relocate(particles)
        return particles

    def _around(self, entries: np.ndarray) -> Particles:
        """At codebook entries (n,), spread over the gaps between them."""
        particles = Particles.from_poses(self._lookup.poses[entries], entries)
        self._motion_model.scatter(particles, self._lookup.spacing)
        return particles
