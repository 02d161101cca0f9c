"""Belief of the filter: a set of pose hypotheses on one or several objects.

A hypothesis is the particle of a Rao-Blackwellised particle filter: a Gaussian over poses, with a weight. It was
aligned to at least one penetration map. Poses of a codebook that no map was compared with yet are *untested*: points,
weighed by codes alone. All poses are of one frame, the last keyframe; `since` is the gel's motion from then to now.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

import midastouch_kernels as kernels
from midastouch_perception.symmetry.group import Symmetry

from .alignment import transform_covariance
from .motion_model import Odometry
from .object_model import ObjectModel
from .particles import Particles

BEHIND = -14.0
"""nats: log-weight, relative to the heaviest, below which a hypothesis is dropped."""
_SAME_T, _SAME_R = 2e-3, np.radians(2.0)  # m, rad: hypotheses nearer to each other have met


@dataclass(frozen=True)
class Hypotheses:
    """P Gaussians over poses.

    poses (P, 4, 4) `T_obj_gel`; covariances (P, 6, 6) of [translation, rotation] in their own frames, m and rad;
    log_weights (P,); objects (P,), number of the object that each is on; aligned_at (P,) [m], reading of the odometer
    when it was last aligned; fit (P,), fraction of the last keyframe's maps that it explains.
    """

    poses: np.ndarray
    covariances: np.ndarray
    log_weights: np.ndarray
    objects: np.ndarray
    aligned_at: np.ndarray
    fit: np.ndarray

    @classmethod
    def none(cls) -> Hypotheses:
        """Return a set without hypotheses."""
        return cls.at(np.empty((0, 4, 4)), np.zeros((6, 6)), np.empty(0), 0, 0.0)

    @classmethod
    def at(
        cls, poses: np.ndarray, covariance: np.ndarray, log_weights: np.ndarray, number: int, odometer: float
    ) -> Hypotheses:
        """Return hypotheses on object `number`, with the same covariance (6, 6), aligned at an odometer reading [m]."""
        n = len(poses)
        spread, on = np.tile(covariance, (n, 1, 1)), np.full(n, number, np.int32)
        return cls(poses, spread, log_weights, on, np.full(n, odometer), np.ones(n))

    def __len__(self) -> int:
        return len(self.poses)

    def some(self, index: np.ndarray) -> Hypotheses:
        """Return the hypotheses of an index or mask."""
        return Hypotheses(*(each[index] for each in vars(self).values()))

    def joined(self, others: Hypotheses) -> Hypotheses:
        """Return these hypotheses, followed by the others."""
        pairs = zip(vars(self).values(), vars(others).values(), strict=True)
        return Hypotheses(*(np.concatenate(pair) for pair in pairs))

    def moved(self, motion: np.ndarray) -> Hypotheses:
        """Return the hypotheses after the gel moved by `motion` (4, 4)."""
        if not len(self):
            return self
        return replace(self, poses=self.poses @ motion, covariances=transform_covariance(self.covariances, motion))

    def widened(self, covariance: np.ndarray) -> Hypotheses:
        """Return the hypotheses with a covariance (6, 6) added to each, in its own frame."""
        return replace(self, covariances=self.covariances + covariance)

    def drifted(self, odometer: float, drift: np.ndarray) -> Hypotheses:
        """Return the hypotheses with a covariance (6, 6) added for every metre since each was last aligned."""
        growth = np.maximum(odometer - self.aligned_at, 0.0)[:, None, None] * drift
        return replace(self, covariances=self.covariances + growth, aligned_at=np.full(len(self), odometer))

    def merged(self, symmetry: Symmetry) -> Hypotheses:
        """Merge hypotheses that have met on one object, modulo its symmetry: the heaviest gets the weight of all."""
        if len(self) < 2:
            return self
        order = np.argsort(-self.log_weights, kind="stable")
        poses = symmetry.nearest(self.poses, self.poses[order[0]])
        # the Frobenius norm between rotations is sqrt(2) times their angle, while that is small
        turned = poses[:, :3, :3].reshape(-1, 9) / (np.sqrt(2) * _SAME_R)
        tree = cKDTree(np.concatenate([poses[:, :3, 3] / _SAME_T, turned], axis=1))
        pairs = tree.query_pairs(1.0, output_type="ndarray")
        if not len(pairs):
            return replace(self, poses=poses)
        rank = np.empty(len(self), int)
        rank[order] = np.arange(len(self))
        # each is merged into the heaviest hypothesis near it that stays
        ranked = np.sort(rank[pairs], axis=1)
        log_weights, into = self.log_weights.copy(), np.arange(len(self))
        for a, b in order[ranked[np.lexsort(ranked.T)]]:
            if into[a] == a and into[b] == b:
                into[b] = a
                log_weights[a] = np.logaddexp(log_weights[a], log_weights[b])
        kept = order[into[order] == order]
        return replace(self, poses=poses, log_weights=log_weights).some(kept)


class Belief:
    """Hypotheses and untested poses on the objects.

    Attributes: objects; hypotheses; untested, for each object poses of its codebook with log-weights, as particles;
    support (O,) [nats], evidence of the touches for each object, against none of the known ones; since (4, 4), motion
    of the gel since the frame that all poses are of.
    """

    def __init__(self, objects: Sequence[ObjectModel]):
        self.objects = objects
        self.hypotheses = Hypotheses.none()
        self.untested = [_no_particles() for _ in objects]
        self.support: np.ndarray = np.zeros(len(objects))
        self._summed: list[np.ndarray | None] = [None for _ in objects]
        self._untested_sum = -np.inf
        self.since = np.eye(4)

    def total(self) -> float:
        """Return the log of the sum of all weights."""
        return _log_sum([_log_sum(self.hypotheses.log_weights), self._untested_total()])

    @property
    def untested_mass(self) -> float:
        """Fraction of the weight that untested poses hold."""
        return float(np.exp(self._untested_total() - self.total()))

    def _untested_total(self) -> float:
        # cached: the many thousand weights change once per keyframe
        weights = [some.log_weights for some in self.untested]
        if not all(now is before for now, before in zip(weights, self._summed, strict=True)):
            self._summed, self._untested_sum = weights, _log_sum([_log_sum(each) for each in weights])
        return self._untested_sum

    def object_masses(self) -> np.ndarray:
        """Return the fraction (O,) of the weight on each object."""
        hypotheses, total = self.hypotheses, self.total()
        own = np.bincount(hypotheses.objects, np.exp(hypotheses.log_weights - total), len(self.objects))
        return own + [np.exp(some.log_weights - total).sum() for some in self.untested]

    def __len__(self) -> int:
        return len(self.hypotheses) + sum(map(len, self.untested))

    def scale(self, factor: float) -> None:
        """Add `factor` [nats] to all log-weights."""
        self.hypotheses = replace(self.hypotheses, log_weights=self.hypotheses.log_weights + factor)
        for some in self.untested:
            some.log_weights = some.log_weights + factor

    def come_up(self, odometer: float, drift: np.ndarray) -> None:
        """Bring all poses to the present frame; arguments as for `Hypotheses.drifted`."""
        self.hypotheses = self.hypotheses.moved(self.since).drifted(odometer, drift)
        row, still = Odometry.from_matrix(self.since).row, np.zeros(6, np.float32)
        for model, some in zip(self.objects, self.untested, strict=True):

            def move(low: int, high: int, _: int, some: Particles = some) -> None:
                kernels.compose(low, high, some.positions, some.quaternions, row, still, None)

            model.workers.run(len(some), move)
        self.since = np.eye(4)

    def expect(
        self, number: int, entries: np.ndarray, log_weights: np.ndarray, poses: np.ndarray | None = None
    ) -> None:
        """Add untested poses at `entries` (n,) of an object's codebook, with log-weights (n,), at the present frame.

        poses (n, 4, 4), if they lie elsewhere: the entries are then those nearest to them. All poses of the belief must
        be of the present frame (`come_up`).
        """
        born = Particles.from_poses(self.objects[number].lookup.poses[entries] if poses is None else poses, entries)
        born.log_weights = log_weights
        self.untested[number] = Particles.joined([self.untested[number], born])

    def take(self, number: int, rows: np.ndarray) -> Particles:
        """Remove untested poses from the belief, by their rows (n,), and return them."""
        some, kept = self.untested[number], np.ones(len(self.untested[number]), bool)
        kept[rows] = False
        self.untested[number] = some.some(kept)
        return some.some(rows)

    def settle(self, negligible: float) -> None:
        """Normalise the weights, drop what is too light to matter, and merge hypotheses that have met.

        negligible: log-weight, relative to the heaviest hypothesis or pose, below which an untested pose is dropped.
        """
        self.scale(-self.total())
        weights = [self.hypotheses.log_weights, *(some.log_weights for some in self.untested)]
        top = max(each.max() for each in weights if len(each))
        left = self.hypotheses.some(self.hypotheses.log_weights > top + BEHIND)
        self.hypotheses = Hypotheses.none()
        for number, model in enumerate(self.objects):
            self.hypotheses = self.hypotheses.joined(left.some(left.objects == number).merged(model.symmetry.exact))
            some = self.untested[number]
            if len(some) and not (keep := some.log_weights > top + negligible).all():
                self.untested[number] = some.some(keep)


def _no_particles() -> Particles:
    return Particles(np.empty((0, 3), np.float32), np.empty((0, 4), np.float32), np.empty(0), np.empty(0, np.int32))


def _log_sum(values: np.ndarray | Sequence[float]) -> float:
    """Return log(sum(exp)) of values (n,), -inf without any."""
    values = np.asarray(values)
    top = values.max(initial=-np.inf)
    return float(top + np.log(np.exp(values - top).sum())) if np.isfinite(top) else -np.inf
