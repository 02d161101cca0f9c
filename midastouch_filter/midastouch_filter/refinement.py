"""Coarse to fine: once particles form narrow modes, let the felt penetration itself place them.

The codebook is as fine as its entries, about 4 mm and 20 deg apart. A narrow mode is close to a Gaussian, and for a
Gaussian the penetration map has a closed-form update: `alignment.py` gives its posterior, and the mode's
particles are moved as a whole so that they have them (a deterministic ensemble Kalman update, Bishop et al. 2001).
It costs a dozen rendered views per mode instead of one per particle.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

import midastouch_kernels as kernels
from midastouch_perception import se3
from midastouch_perception.mesh import ObjectMesh
from midastouch_perception.sensor_model import SensorModel

from .alignment import Aligned, PenetrationAlignment, without_jitter
from .config import FilterConfig
from .estimate import Mode
from .joint_alignment import FeltPenetration, align_in_turn, carried
from .particles import Particles
from .resampling import log_sum_exp
from .workers import Workers

PENETRATION_SCALE = 0.25  # of the camera image: 80 x 60
_FLOOR = np.repeat([2e-4, np.radians(0.3)], 3) ** 2  # m^2, rad^2: no mode is surer than this before it is aligned
_ONE_OPTIMUM = 4e-3, np.radians(12.0)  # m, rad: a mode that spreads no wider is aligned from its mean alone
_TRIES = 4  # particles that a wider one is aligned from besides
_DECISIVE = 3.0  # nats
_ELSEWHERE = 22.5  # squared Mahalanobis distance that 99.9 % of poses of one Gaussian keep below (6 degrees of freedom)
_LARGEST_EVIDENCE = 5.0  # nats one penetration may speak for one mode and against another


class Refinement:
    """Moves the particles of narrow modes to where the penetration puts them."""

    def __init__(self, mesh: ObjectMesh, sensor: SensorModel, config: FilterConfig, workers: Workers):
        self._config, self._workers = config, workers
        self.alignment = PenetrationAlignment(
            mesh, sensor.scaled(PENETRATION_SCALE), config.relief_noise, config.relief_correlation
        )
        self._jitter = config.jitter

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the penetrations."""
        return self.alignment.sensor.gel_depth.shape

    def apply(
        self,
        particles: Particles,
        members: np.ndarray,
        modes: list[Mode],
        penetrations: Sequence[FeltPenetration],
        share: float,
    ) -> dict[int, Aligned]:
        """Update the particles of narrow modes in place; returns what the penetrations say of each of them, by mode.

        members (N,): mode of each particle, -1 for none; penetrations: one or more,
        those `reached` of all fingers in this
        frame; share in [0, 1]: how much of this frame is evidence independent of the last. Between several narrow
        modes, mass moves to those the penetrations fit.
        """
        c = self._config
        priors = self._priors(modes)
        narrow = list(priors)
        tries = [(k, start) for k in narrow for start in _starts(modes[k], particles, np.flatnonzero(members == k))]
        found = self._workers.map(
            lambda each: align_in_turn(
                self.alignment,
                modes[each[0]].pose,
                priors[each[0]] + self._jitter,
                penetrations,
                c.finger_error,
                each[1],
            ),
            tries,
        )
        aligned = {}
        for k in narrow:
            best = _agreed([each for (mode, _), each in zip(tries, found, strict=True) if mode == k], c.relief_fit)
            if best is not None:
                aligned[k] = best
        maps = {
            k: _GaussianMap.between(
                modes[k].pose, priors[k], *without_jitter(modes[k].pose, priors[k], self._jitter, posterior)
            )
            for k, posterior in aligned.items()
            if posterior.fit > c.relief_fit
        }
        if maps:
            self._move(particles, members, maps, len(modes))
        if len(aligned) > 1:
            self._weigh(particles, members, aligned, share, len(modes))
        return aligned

    def sharpened(
        self, particles: Particles, members: np.ndarray, modes: list[Mode], aligned: dict[int, Aligned]
    ) -> Particles:
        """A copy of the particles with those of the aligned modes where this very frame has them, as `sharpened`."""
        maps = {
            k: _GaussianMap.between(modes[k].pose, _in_own_frame(modes[k]) + np.diag(_FLOOR), a.pose, a.covariance)
            for k, a in aligned.items()
        }
        copy = replace(particles, positions=particles.positions.copy(), quaternions=particles.quaternions.copy())
        self._move(copy, members, maps, len(modes))
        return copy

    def is_narrow(self, mode: Mode) -> bool:
        """Whether the mode is close enough to a Gaussian to be aligned."""
        c = self._config
        return mode.spread_translation < c.refine_translation and mode.spread_rotation < c.refine_rotation

    def reached(self, modes: list[Mode], penetrations: Sequence[FeltPenetration]) -> list[FeltPenetration]:
        """Those of fingers that all narrow modes say well enough where they are; the reference always is.

        All modes are aligned to the same penetrations, so that their evidence can be compared.
        """
        priors = self._priors(modes).values() if len(penetrations) > 1 or penetrations[0].name else ()

        def is_reached(felt: FeltPenetration) -> bool:
            if felt.T_gel_finger is None:
                return True
            spreads = [np.sqrt(np.trace(carried(prior, felt.T_gel_finger)[:3, :3])) for prior in priors]
            return max(spreads, default=0.0) < self._config.refine_translation

        return [felt for felt in penetrations if is_reached(felt)]

    def _priors(self, modes: list[Mode]) -> dict[int, np.ndarray]:
        """Covariances (6, 6) of the narrow ones of the modes to align, in their own frames."""
        chosen = enumerate(modes[: self._config.refined_modes])
        return {k: _in_own_frame(mode) + np.diag(_FLOOR) for k, mode in chosen if self.is_narrow(mode)}

    def _move(self, particles: Particles, members: np.ndarray, maps: dict[int, _GaussianMap], count: int) -> None:
        map_of = np.full(count + 1, -1)  # the last stands for -1: no mode
        map_of[list(maps)] = np.arange(len(maps))
        table = tuple(np.stack(column) for column in zip(*maps.values(), strict=True))
        self._workers.run(
            len(particles),
            lambda low, high, _: kernels.map_modes(
                low, high, map_of[members[low:high]], *table, particles.positions, particles.quaternions
            ),
        )

    @staticmethod
    def _weigh(
        particles: Particles, members: np.ndarray, aligned: dict[int, Aligned], share: float, count: int
    ) -> None:
        best = max(a.log_evidence for a in aligned.values())
        gain = np.full(count + 1, np.nan)
        for k, posterior in aligned.items():
            gain[k] = share * max(posterior.log_evidence - best, -_LARGEST_EVIDENCE)
        gain = gain[members]
        concerned = np.flatnonzero(np.isfinite(gain))
        before = particles.log_weights[concerned]
        after = before + gain[concerned]
        particles.log_weights[concerned] = after + (log_sum_exp(before) - log_sum_exp(after))


def _starts(mode: Mode, particles: Particles, members: np.ndarray) -> list[np.ndarray]:
    """Poses (4, 4) to look for the optimum from: the mode's own and, if it may hold several optima, some particles'."""
    starts = [mode.pose]
    if mode.spread_translation > _ONE_OPTIMUM[0] or mode.spread_rotation > _ONE_OPTIMUM[1]:
        some = members[np.linspace(0, len(members) - 1, min(_TRIES, len(members))).astype(int)]
        rows = np.concatenate([particles.positions[some], particles.quaternions[some]], axis=1)
        starts += list(se3.from_xyzquat(rows))
    return starts


def _agreed(found: list[Aligned], least_fit: float) -> Aligned | None:
    """The best of several optima that fit; None if another one, elsewhere, explains the penetration nearly as well.

    Where none fits, the mode's own. (A pose that feels nothing at all leaves the prior wide, for which the evidence
    praises it.)
    """
    fitting = [each for each in found if each.fit > least_fit]
    if not fitting:
        return found[0]
    best = max(fitting, key=lambda each: each.log_evidence)
    precision = np.linalg.inv(best.covariance)
    for other in fitting:
        apart = se3.log(se3.inverse(best.pose) @ other.pose)
        if best.log_evidence - other.log_evidence < _DECISIVE and apart @ precision @ apart > _ELSEWHERE:
            return None
    return best


def sharpened(mode: Mode, aligned: Aligned) -> Mode:
    """The mode with the pose of this very frame: where the penetration puts the sensor, the arm's jitter included."""
    turn = se3.turn(aligned.pose[:3, :3])
    return replace(mode, pose=aligned.pose, covariance=turn @ aligned.covariance @ turn.T)


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
        """By the Cholesky factors of both covariances, each in its pose's own frame."""
        shrink = np.linalg.cholesky(covariance) @ np.linalg.inv(np.linalg.cholesky(prior))
        parts = ((p[:3, 3], p[:3, :3], se3.to_xyzquat(p)[3:]) for p in (pose, mean))
        return cls(*itertools.chain(*parts), shrink)
