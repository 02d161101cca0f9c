"""What the filter believes: particles with weights, their modes, and the covariance to publish."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

import midastouch_kernels as kernels
from midastouch_common import se3
from midastouch_perception.symmetry.group import Symmetry

from .alignment import Aligned
from .estimate import Mode, modes_from_moments
from .lookup import PoseLookup
from .modes import ModeFinder
from .particles import Particles
from .pose_hypothesis import pose_distance

_COPY = 1e-3  # m: nearer to its equivalent a mode is where it should be; to a free axis, it is narrow
_SAMPLE = 4096  # particles that the other hypotheses are judged by


class Belief:
    """Particles and what is derived from them.

    Attributes: particles; weights (N,), sum 1; modes of the particles, heaviest first, none before the first `cluster`;
    aligned, by number of the mode, the alignment of each mode that the present penetration maps fitted; aligned_to,
    names of the fingers that measured these maps (both empty once the particles change); answers, the modes to be
    published, sharpened where they are aligned; explained, names of the fingers whose last maps the heaviest one fits.
    The belief is one over poses modulo the symmetry of the object: no mode is another one's copy.
    """

    def __init__(self, particles: Particles, lookup: PoseLookup, finder: ModeFinder, symmetry: Symmetry):
        self._lookup, self._finder, self._symmetry = lookup, finder, symmetry
        self.restart(particles)

    def restart(self, particles: Particles) -> None:
        """Start again with these particles."""
        self._path = 0.0  # since the last look-up
        self.modes: list[Mode] = []
        self.answers: list[Mode] = []
        self.explained: frozenset[str] = frozenset()
        self._forget_alignment()
        self.hold(particles)

    def hold(self, particles: Particles) -> None:
        """Replace the particles."""
        self.particles, self.weights = particles, particles.weights
        self._members: np.ndarray | None = None  # computed when first asked for

    def follow_entries(self, now: np.ndarray) -> None:
        """The look-up has other entries: the former ones are near `now` (M,) int32. Finds the modes anew."""
        self.particles.entries = now[self.particles.entries]
        self.cluster()

    def moved(self, path: float) -> None:
        """The particles moved by `path` [m], turns included."""
        self._path += path

    def look_up(self) -> np.ndarray:
        """Set each particle's codebook entry; returns the pose distances (N,) [m] to it."""
        if self._path > self._lookup.reach:
            self._lookup.relocate(self.particles)
        self._path, self._members = 0.0, None
        return self._lookup.follow(self.particles)

    def reweigh(self, log_ratio: np.ndarray, tempered: np.ndarray) -> tuple[float, bool]:
        """Multiply the weights by the tempered likelihood ratios (N,) and normalise.

        Returns the log marginal likelihood ratio, of `log_ratio` (N,) itself, and whether a particle survives: if none
        does, all stays as it was.
        """
        log_weights, weights = np.empty(len(log_ratio)), np.empty(len(log_ratio))
        likelihood, total = kernels.reweigh(self.particles.log_weights, log_ratio, tempered, log_weights, weights)
        alive = bool(np.isfinite(total))
        if alive:
            self.particles.log_weights, self.weights = log_weights, weights
        return likelihood, alive

    def cluster(self) -> None:
        """Find the modes anew (paper section 4.3, hypothesis clustering), modulo symmetry."""
        self._find_modes()
        if self._fold():
            self._find_modes()

    def _find_modes(self) -> None:
        self.modes = self.answers = modes_from_moments(self._finder.find(self.particles, self.weights))
        self._members = None
        self._forget_alignment()

    def _fold(self) -> bool:
        """Move modes that are farther from the heaviest one than an equivalent pose is there; whether any was.

        A mode goes as a whole, by the motion that suits its mean. What the symmetry leaves free, about an axis, each
        particle is turned by for itself, as a mode may reach all around it.
        """
        symmetry = self._symmetry
        if symmetry.trivial or not self.modes:
            return False
        goal, free = self.modes[0].pose, symmetry.free != "none"
        means = np.stack([mode.pose for mode in self.modes])
        images = symmetry.nearest(means, goal)
        apart = pose_distance(means, images) > _COPY
        apart[0] = free and self.modes[0].spread_translation > _COPY
        rows = np.flatnonzero(np.append(apart, False)[self.members])
        if not len(rows):
            return False
        poses = self.particles.select(rows).poses
        if free:
            poses = symmetry.nearest(poses, goal)
        else:
            motions = images @ se3.inverse(means)
            poses = motions[self.members[rows]] @ poses
        self.particles.replace(rows, Particles.from_poses(poses, self._lookup.exact(poses)))
        return True

    def _forget_alignment(self) -> None:
        self.aligned: dict[int, Aligned] = {}
        self.aligned_to: frozenset[str] = frozenset()

    def align(
        self,
        aligned: dict[int, Aligned],
        gains: np.ndarray,
        names: frozenset[str],
        widening: Callable[[Aligned], float],
    ) -> None:
        """The particles were moved by what these fingers' maps say of the modes, by their number, whose masses change.

        gains (m,): log-factors of the masses of all modes; no mass in all comes or goes. widening: factors on the
        covariances of the answers.
        """
        finder = self._finder
        of_peak = {finder.peaks[k]: each for k, each in aligned.items()}
        if gains.any():
            of_member, members = np.append(gains, 0.0), self.members  # the last stands for -1: no mode
            self.particles.log_weights += of_member[members]
            self.weights = self.weights * np.exp(of_member)[members]
        self.modes, self._members = modes_from_moments(finder.moments(self.particles, self.weights)), None
        self.aligned = {k: of_peak[peak] for k, peak in enumerate(finder.peaks) if peak in of_peak}
        self.aligned_to = names
        self.answers = [
            sharpened(mode, self.aligned[k], widening(self.aligned[k])) if k in self.aligned else mode
            for k, mode in enumerate(self.modes)
        ]

    @property
    def dominant_mass(self) -> float:
        """Weight of the heaviest mode, 0 while none was looked for."""
        return self.modes[0].weight if self.modes else 0.0

    @property
    def members(self) -> np.ndarray:
        """Mode (N,) int32 of each particle, -1 for none."""
        if self._members is None:
            self._members = self._finder.members(self.particles)
        return self._members

    @property
    def covariance(self) -> np.ndarray:
        """Covariance (6, 6) of the whole belief about the published pose."""
        return covariance_about(self.answers[0], self.members, self.particles, self.weights)


def sharpened(mode: Mode, aligned: Aligned, widening: float) -> Mode:
    """The mode with the pose of this very frame: where the map puts the sensor, the arm's jitter included.

    widening: factor on its covariance, by which it is as wide as the truth is far.
    """
    turn = se3.turn(aligned.pose[:3, :3])
    return replace(mode, pose=aligned.pose, covariance=widening * turn @ aligned.covariance @ turn.T)


def covariance_about(mode: Mode, members: np.ndarray, particles: Particles, weights: np.ndarray) -> np.ndarray:
    """Covariance (6, 6) of the belief about the dominant mode's pose, in the order and axes of `Mode.covariance`.

    A mode's own covariance says how well its pose is known if it is the right one. The published covariance must also
    say how far away the truth lies if it is another one. So the part of the others is the second moment of position
    and rotation vector about the mode's pose; the mode's own part is its covariance. members (N,) int32: the mode of
    each particle, 0 for this one; weights (N,), sum 1.
    """
    position = kernels.decompose(mode.pose)[1]
    mass, moment = kernels.second_moment(
        particles.positions, particles.quaternions, weights, members, position, _SAMPLE
    )
    return (1.0 - mass) * mode.covariance + mass * moment
