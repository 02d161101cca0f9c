"""Refinement: a narrow mode is moved as a whole to where the measured penetration maps put it.

The codebook is as fine as its entries, about 4 mm and 20 deg apart. A narrow mode is close to a Gaussian, and for a
Gaussian the update by a penetration map has a closed form: `alignment.py` gives the posterior mean and covariance, and
the mode's particles are moved as a whole so that they have them (a deterministic ensemble Kalman update, Bishop et al.
2001). It costs a dozen rendered views per mode instead of one per particle.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

import midastouch_kernels as kernels
from midastouch_common import se3

from ..core.alignment import (
    Aligned,
    CredibleRegion,
    PenetrationAlignment,
    align_in_turn,
    transform_covariance,
    without_jitter,
)
from ..core.config import FilterConfig
from ..core.estimate import Mode
from ..core.noise_model import Effort, NoiseModel
from ..core.particles import Particles
from ..core.touch import Measurement
from ..core.workers import Workers


class Refinement:
    """Moves the particles of narrow modes to where penetration maps put them.

    Args: alignment; config; noise; effort; workers.
    Attribute: region, how far from an aligned pose the truth may be.
    """

    def __init__(
        self,
        alignment: PenetrationAlignment,
        config: FilterConfig,
        noise: NoiseModel,
        effort: Effort,
        workers: Workers,
    ):
        self._alignment, self._config, self._workers = alignment, config, workers
        self._noise, self._effort = noise, effort
        self.region = CredibleRegion(noise)

    def apply(
        self,
        particles: Particles,
        members: np.ndarray,
        modes: list[Mode],
        touches: Sequence[Measurement],
    ) -> dict[int, Aligned]:
        """Move the particles of narrow modes in place; returns what the maps say of each of them, by mode.

        members (N,): mode of each particle, -1 for none; touches: one or more of this frame, with maps, of fingers that
        the modes reach.
        """
        priors = self._priors(modes)
        aligned = self._align(particles, members, modes, priors, touches)
        jitter = self._noise.jitter
        if 0 in aligned and aligned[0].fit > self._config.penetration_fit:
            self.region.follow(modes[0].pose, priors[0] + jitter, aligned[0])
        maps = {
            k: _GaussianMap.between(
                modes[k].pose, priors[k], *without_jitter(modes[k].pose, priors[k], jitter, posterior)
            )
            for k, posterior in aligned.items()
            if posterior.fit > self._config.penetration_fit
        }
        if maps:
            self._move(particles, members, maps, len(modes))
        return aligned

    def gains(self, modes: list[Mode], aligned: dict[int, Aligned], tempering: float) -> np.ndarray:
        """(m,) log-factors of the modes' masses: between those that are aligned, mass moves to where the maps fit.

        tempering exponent of this frame. Together they keep their mass.
        """
        out = np.zeros(len(modes))
        if len(aligned) > 1:
            chosen, residual_ratio = list(aligned), 1.0 - np.array([each.fit for each in aligned.values()])
            mass, evidence = np.array([modes[k].weight for k in chosen]), self._noise.residual_evidence(residual_ratio)
            gain = tempering * (evidence - evidence.max())
            out[chosen] = gain + np.log(mass.sum() / (mass * np.exp(gain)).sum())
        return out

    def _align(
        self,
        particles: Particles,
        members: np.ndarray,
        modes: list[Mode],
        priors: dict[int, np.ndarray],
        touches: Sequence[Measurement],
    ) -> dict[int, Aligned]:
        """Posterior of each mode that has a prior, but of those for which several starts disagree."""
        jitter, error = self._noise.jitter, self._noise.finger_error
        tries = [(k, start) for k in priors for start in self._starts(k, modes[k], particles, members)]
        found = self._workers.map(
            lambda each: align_in_turn(
                self._alignment, modes[each[0]].pose, priors[each[0]] + jitter, touches, error, each[1]
            ),
            tries,
        )
        of_mode = {k: [each for (mode, _), each in zip(tries, found, strict=True) if mode == k] for k in priors}
        agreed = {k: self._agreed(optima) for k, optima in of_mode.items()}
        return {k: optimum for k, optimum in agreed.items() if optimum is not None}

    def _starts(self, k: int, mode: Mode, particles: Particles, members: np.ndarray) -> list[np.ndarray]:
        """Poses (4, 4) to look for mode k's optimum from: its own and, if it may hold several, some particles'."""
        starts = [mode.pose]
        translation, rotation = np.sqrt(np.diag(self._noise.between_entries))[[0, 3]]
        if mode.spread_translation > translation or mode.spread_rotation > rotation:
            own = np.flatnonzero(members == k)
            some = own[np.linspace(0, len(own) - 1, min(self._effort.starts, len(own))).astype(int)]
            rows = np.concatenate([particles.positions[some], particles.quaternions[some]], axis=1)
            starts += list(se3.from_xyzquat(rows))
        return starts

    def _agreed(self, found: list[Aligned]) -> Aligned | None:
        """The best of several optima that fit; None if another one, elsewhere, explains the map nearly as well.

        Where none fits, the mode's own. (A pose that touches nothing at all leaves the prior wide, for which the
        evidence praises it.)
        """
        fitting = [each for each in found if each.fit > self._config.penetration_fit]
        if not fitting:
            return found[0]
        best = max(fitting, key=lambda each: each.log_evidence)
        if len(fitting) == 1:
            return best
        precision = np.linalg.inv(best.covariance)
        for other in fitting:
            offset = se3.log(se3.inverse(best.pose) @ other.pose)
            close = best.log_evidence - other.log_evidence < self._noise.decisive
            if close and offset @ precision @ offset > self._noise.elsewhere:
                return None
        return best

    def sharpened(
        self, particles: Particles, members: np.ndarray, modes: list[Mode], aligned: dict[int, Aligned]
    ) -> Particles:
        """A copy of the particles with those of the aligned modes where this very frame has them, as `sharpened`."""
        maps = {
            k: _GaussianMap.between(
                modes[k].pose, _in_own_frame(modes[k]) + self._noise.mode_floor, a.pose, a.covariance
            )
            for k, a in aligned.items()
        }
        copy = replace(particles, positions=particles.positions.copy(), quaternions=particles.quaternions.copy())
        self._move(copy, members, maps, len(modes))
        return copy

    def reaches(self, modes: list[Mode], T_gel_finger: np.ndarray | None) -> bool:
        """Whether all narrow modes say well enough where a finger is; the first one (None) always is where they say.

        All modes are aligned to the same maps, so that their evidence can be compared.
        """
        if T_gel_finger is None:
            return True
        at_finger = [transform_covariance(prior, T_gel_finger) for prior in self._priors(modes).values()]
        spreads = [np.sqrt(np.trace(covariance[:3, :3])) for covariance in at_finger]
        return max(spreads, default=0.0) < self._config.refine_translation

    def _priors(self, modes: list[Mode]) -> dict[int, np.ndarray]:
        """Covariances (6, 6) of the narrow ones of the modes to align, in their own frames."""
        chosen = enumerate(modes[: self._config.refined_modes])
        return {k: _in_own_frame(mode) + self._noise.mode_floor for k, mode in chosen if is_narrow(mode, self._config)}

    def _move(self, particles: Particles, members: np.ndarray, maps: dict[int, _GaussianMap], count: int) -> None:
        map_of = np.full(count, -1, np.int32)
        map_of[list(maps)] = np.arange(len(maps))
        table = tuple(np.stack(column) for column in zip(*maps.values(), strict=True))
        self._workers.run(
            len(particles),
            lambda low, high, _: kernels.map_modes(
                low, high, members, map_of, *table, particles.positions, particles.quaternions
            ),
        )


def is_narrow(mode: Mode, config: FilterConfig) -> bool:
    """Whether the mode is close enough to a Gaussian to be aligned."""
    return mode.spread_translation < config.refine_translation and mode.spread_rotation < config.refine_rotation


def _in_own_frame(mode: Mode) -> np.ndarray:
    """A mode's covariance (6, 6) in its pose's own axes instead of the object's."""
    turn = se3.turn(mode.pose[:3, :3])
    return turn.T @ mode.covariance @ turn


class _GaussianMap(NamedTuple):
    """Affine map of deviations that turns N(pose, prior) into N(mean, covariance).

    position (3,), rotation (3, 3) and quaternion (4,) of the pose before, then of that after; shrink (6, 6).
    """

    position: np.ndarray
    rotation: np.ndarray
    quaternion: np.ndarray
    new_position: np.ndarray
    new_rotation: np.ndarray
    new_quaternion: np.ndarray
    shrink: np.ndarray

    @classmethod
    def between(cls, pose: np.ndarray, prior: np.ndarray, mean: np.ndarray, covariance: np.ndarray) -> _GaussianMap:
        """From N(pose (4, 4), prior (6, 6)) to N(mean, covariance), each in its own frame, by Cholesky factors."""
        shrink = np.linalg.cholesky(covariance) @ np.linalg.inv(np.linalg.cholesky(prior))
        parts = ((p[:3, 3], p[:3, :3], se3.to_xyzquat(p)[3:]) for p in (pose, mean))
        return cls(*itertools.chain(*parts), shrink)
