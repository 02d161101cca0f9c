"""The paper's own particle filter (section 4.3 and appendix C), as the baseline of every comparison.

It follows the text, not the authors' code, where the two differ: systematic resampling at every step, hypotheses at
every step, the floor of 1000 particles, the 6-vector (t, alpha log R). What the text leaves open is marked below.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from pykdtree.kdtree import KDTree
from scipy.spatial.transform import Rotation
from sklearn.cluster import DBSCAN

from midastouch_common.mesh import ObjectMesh
from midastouch_common.pose_metric import ROTATION_SCALE
from midastouch_filter.core import initialisation, resampling
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.estimate import Estimate, Mode, modes_from_moments
from midastouch_filter.core.gates import Stopwatch
from midastouch_filter.core.modes import Moments
from midastouch_filter.core.motion_model import MotionModel, Odometry
from midastouch_filter.core.particles import Particles
from midastouch_filter.core.state import StateEvidence, StateMachine, Status
from midastouch_filter.core.workers import Workers

if TYPE_CHECKING:
    from midastouch_filter.core.touch import Measurement
    from midastouch_perception.codebook import Codebook

_SURFACE_SPACING = 5e-4  # m, between the points that stand for the surface
_MOST_SURFACE_POINTS = 400_000
_CELLS_PER_EPS = 3


@dataclass(frozen=True)
class PaperConfig:
    """Constants of the paper; metres and radians.

    n_start, n_least: particles at the start and at least (appendix C). noise_translation, noise_rotation: sigma of one
    step's odometry per axis; the text gives none, so it is what two poses with the data's noise of 0.5 mm and 1 deg
    (section 5) differ by. prune_distance: appendix C. eps: of DBSCAN; not in the text. min_samples: of DBSCAN, twice
    the dimension as the paper's reference 68 has it.
    """

    n_start: int = 50_000
    n_least: int = 1_000
    noise_translation: float = float(np.sqrt(2) * 5e-4)
    noise_rotation: float = float(np.sqrt(2) * np.radians(1.0))
    prune_distance: float = 2e-3
    eps: float = 0.01
    min_samples: int = 6


class PaperFilter:
    """Distribution of the sensor pose `T_obj_gel`, with the interface of `ParticleFilter`.

    Args: mesh; codebook of that mesh; config; clock: seconds, for the milliseconds per stage in `Status`;
    threads, of the compiled kernels (0: one per core). The state, which the paper does not have, is told from mass and
    spread of the heaviest hypothesis by the limits of `FilterConfig`.
    """

    def __init__(
        self,
        mesh: ObjectMesh,
        codebook: Codebook,
        config: PaperConfig | None = None,
        clock: Callable[[], float] = lambda: 0.0,
        threads: int = 0,
    ):
        self.config = config or PaperConfig()
        self._workers = Workers(threads)
        self._motion_config = FilterConfig(
            noise_translation=self.config.noise_translation,
            noise_rotation=self.config.noise_rotation,
            noise_per_metre=0.0,
            noise_per_radian=0.0,
        )
        self._poses = np.asarray(codebook.poses, float)
        self._codes = codebook.codes / np.maximum(np.linalg.norm(codebook.codes, axis=1, keepdims=True), 1e-12)
        book = Particles.from_poses(self._poses, np.arange(len(self._poses)))
        self._book = KDTree(_six_vectors(book))
        # the paper prunes by the mesh's vertices, which lie dense on its meshes; on others only the surface serves
        count = int(np.clip(mesh.area / _SURFACE_SPACING**2, 1_000, _MOST_SURFACE_POINTS))
        self._surface = KDTree(mesh.sample_surface(count, np.random.default_rng(0))[0].astype(np.float32))
        self._clock = clock
        self.reset(0)

    def reset(self, seed: int) -> None:
        """Forget everything but object and settings."""
        self._rng = np.random.default_rng(seed)
        self._motion = MotionModel(self._motion_config, self._rng, self._workers)
        self._state = StateMachine(self._motion_config)
        self._particles: Particles | None = None
        self._spread: float | None = None
        self._modes: list[Mode] = []
        self._in_contact = False

    def initialise_uniform(self) -> None:
        """Start at codebook poses drawn over the whole surface."""
        entries = initialisation.uniform_entries(len(self._poses), self.config.n_start, self._rng)
        self._particles = Particles.from_poses(self._poses[entries], entries)

    def initialise_gaussian(self, prior: np.ndarray, sigma_t: float, sigma_r: float) -> None:
        """Start around a prior `T_obj_gel` (4, 4) with sigma_t [m] and sigma_r [rad] per axis, each particle moved to
        its nearest codebook pose."""
        drawn = initialisation.gaussian_poses(prior, sigma_t, sigma_r, self.config.n_start, self._rng)
        self._particles = Particles.from_poses(drawn, np.zeros(len(drawn)))
        self._to_codebook()

    def step(self, odometry: np.ndarray | None, measurement: Measurement, elapsed: float | None = None) -> Estimate:
        """Motion, measurement update, pruning, clustering, annealing, resampling: one step of section 4.3.

        odometry: `inv(p_prev) p_now` (4, 4), None on the first frame; elapsed is of no use to it.
        """
        watch = Stopwatch(self._clock)
        if self._particles is None:
            self._state.update(StateEvidence())
            return Estimate([], Status(self._state.state, self._state.reason))
        self._in_contact = measurement.in_contact
        with watch.stage("motion"):
            if odometry is not None:
                self._motion.propagate(self._particles, Odometry.from_matrix(odometry), 1.0)
        with watch.stage("lookup"):
            self._particles.entries = self._book.query(_six_vectors(self._particles))[1].astype(np.int32)
        with watch.stage("weights"):
            weights = self._weights_of(self._code(measurement))
        with watch.stage("modes"):
            self._modes = self._hypotheses(weights)
        with watch.stage("resampling"):
            kept = self._anneal(weights)
            ancestors = resampling.systematic(weights[kept], len(kept), self._rng)
            self._particles = self._particles.select(kept[ancestors])
        return self._report(watch)

    def _code(self, measurement: Measurement) -> np.ndarray:
        """The measured code (D,); without contact a random one (appendix C)."""
        if measurement.in_contact and measurement.code is not None:
            return np.asarray(measurement.code, np.float32)
        return self._rng.standard_normal(self._codes.shape[1], dtype=np.float32)

    def _weights_of(self, code: np.ndarray) -> np.ndarray:
        """Equation 2: softmax of the cosines; 0 for particles off the surface (appendix C)."""
        cosine = (self._codes @ (code / np.linalg.norm(code)))[self._particles.entries].astype(float)
        weights = np.exp(cosine - cosine.max())
        distance = self._surface.query(self._particles.positions)[0]
        weights[distance > self.config.prune_distance] = 0.0
        if not weights.any():  # the text does not say what then; as at the start, the codebook is where touches are
            self._to_codebook()
            weights[:] = 1.0
        return weights / weights.sum()

    def _to_codebook(self) -> None:
        entries = self._book.query(_six_vectors(self._particles))[1].astype(np.int32)
        self._particles = Particles.from_poses(self._poses[entries], entries)

    def _hypotheses(self, weights: np.ndarray) -> list[Mode]:
        """DBSCAN over the positions, then mean position and Markley's mean rotation of each cluster.

        Particles in one cell of a third of eps stand for each other: all pairs of particles of a narrow
        distribution would not fit into memory.
        """
        p = self._particles
        cells = np.floor(p.positions * (_CELLS_PER_EPS / self.config.eps)).astype(np.int64)
        cells -= cells.min(axis=0)
        index = np.ravel_multi_index(cells.T, cells.max(axis=0) + 1)
        _, cell, count = np.unique(index, return_inverse=True, return_counts=True)
        centres = np.stack([np.bincount(cell, p.positions[:, k]) for k in range(3)], axis=1) / count[:, None]
        clustering = DBSCAN(eps=self.config.eps, min_samples=self.config.min_samples)
        label = clustering.fit(centres, sample_weight=count).labels_[cell]
        mass = np.bincount(label[label >= 0], weights[label >= 0])
        order = np.argsort(-mass, kind="stable")
        moments = [_moments(p, weights, np.flatnonzero(label == k)) for k in order if mass[k] > 0]
        return modes_from_moments(_stack(moments)) if moments else []

    def _anneal(self, weights: np.ndarray) -> np.ndarray:
        """Particles (n,) to go on with, by their index: fewer of the lightest or more of the heaviest, as the spread of
        the hypotheses has shrunk or grown (appendix C)."""
        n = len(weights)
        order = np.argsort(-weights, kind="stable")
        spread = np.mean([np.sqrt(np.diag(m.covariance)[:3]).mean() for m in self._modes]) if self._modes else None
        ratio = spread / self._spread if spread and self._spread else 1.0
        self._spread = spread
        wanted = int(np.clip(round(n * ratio), self.config.n_least, self.config.n_start))
        return order[np.arange(wanted) % n] if wanted > n else np.sort(order[:wanted])

    @property
    def poses(self) -> np.ndarray:
        """Particles `T_obj_gel` (N, 4, 4); N = 0 while uninitialised."""
        return self._particles.poses if self._particles else np.empty((0, 4, 4))

    @property
    def weights(self) -> np.ndarray:
        """Weights (N,), all the same: each step ends with resampling."""
        return self._particles.weights if self._particles else np.empty(0)

    def _report(self, watch: Stopwatch) -> Estimate:
        dominant = self._modes[0] if self._modes else None
        mass = dominant.weight if dominant else 0.0
        spread_t = dominant.spread_translation if dominant else 0.0
        spread_r = dominant.spread_rotation if dominant else 0.0
        state, reason = self._state.update(
            StateEvidence(True, self._in_contact, mode_mass=mass, spread_t=spread_t, spread_r=spread_r)
        )
        n = len(self._particles)
        status = Status(state, reason, n, float(n), len(self._modes), mass, spread_t, spread_r, ms=watch.ms)
        return Estimate(self._modes, status, dominant.covariance if dominant else None)


def _six_vectors(particles: Particles) -> np.ndarray:
    """(N, 6) float32: position and alpha times the log of the rotation (section 4.2)."""
    log = Rotation.from_quat(particles.quaternions).as_rotvec()
    return np.concatenate([particles.positions, ROTATION_SCALE * log], axis=1).astype(np.float32)


def _moments(particles: Particles, weights: np.ndarray, which: np.ndarray) -> tuple:
    """Row of `Moments` of the particles with indices `which` (n,)."""
    w = weights[which]
    mass = w.sum()
    w = w / mass
    t, q = particles.positions[which].astype(float), particles.quaternions[which].astype(float)
    reference = np.concatenate([t[np.argmax(w)], q[np.argmax(w)]])
    q = np.where((q @ reference[3:] < 0)[:, None], -q, q)
    x = np.concatenate([np.ones((len(which), 1)), t - reference[:3], q], axis=1)
    return reference, mass, len(which), x.T @ (w[:, None] * x)


def _stack(rows: list[tuple]) -> Moments:
    return Moments(*(np.array(column) for column in zip(*rows, strict=True)))
