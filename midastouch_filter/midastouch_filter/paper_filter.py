"""The paper's own particle filter (section 4.3 and appendix C), as the baseline of every comparison: preset `paper`.

It follows the text, not the authors' code, where the two differ: systematic resampling at every step, hypotheses at
every step, the floor of 1000 particles, the 6-vector (t, alpha log R). Comments mark what the text leaves open.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from pykdtree.kdtree import KDTree
from scipy.spatial.transform import Rotation

import midastouch_kernels as kernels
from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_common.pose_metric import ROTATION_SCALE
from midastouch_perception.symmetry.search import ObjectSymmetry

from .core.config import FilterConfig
from .core.estimate import Estimate, Mode
from .core.gates import Stopwatch
from .core.motion_model import Odometry
from .core.pace import InTime, always
from .core.particles import Particles
from .core.state import StateEvidence, StateMachine, Status
from .core.touch import Measurement, require_network
from .core.workers import CHUNKS, Workers

if TYPE_CHECKING:
    from midastouch_perception.codebook import Codebook

_SURFACE_SPACING = 5e-4  # m, between the points that stand for the surface
_MOST_SURFACE_POINTS = 400_000
_CELLS_PER_EPS = 3


@dataclass(frozen=True)
class PaperConfig:
    """Constants of the paper; metres and radians.

    n_start, n_least: number of particles at the start, and the fewest later (appendix C). noise_translation,
    noise_rotation: sigma of one step's odometry per axis. The text gives none; it is the difference of two poses that
    each have the data's noise of 0.5 mm and 1 deg (section 5). prune_distance: appendix C. eps, min_samples: of DBSCAN.
    The text does not give eps; min_samples is twice the dimension, as in the paper's reference 68.
    """

    n_start: int = 50_000
    n_least: int = 1_000
    noise_translation: float = float(np.sqrt(2) * 5e-4)
    noise_rotation: float = float(np.sqrt(2) * np.radians(1.0))
    prune_distance: float = 2e-3
    eps: float = 0.01
    min_samples: int = 6


class PaperObject:
    """A codebook as the paper uses it. Attributes: poses (M, 4, 4); codes (M, D) of length 1; tree of 6-vectors;
    network_id of the codes, "" if unknown; symmetry that the codebook states, none by default."""

    def __init__(self, codebook: Codebook):
        self.poses = np.asarray(codebook.poses, float)
        self.codes = codebook.codes / np.maximum(np.linalg.norm(codebook.codes, axis=1, keepdims=True), 1e-12)
        self.tree = KDTree(_six_vectors(Particles.from_poses(self.poses, np.arange(len(self.poses)))))
        self.network_id, self.symmetry = str(codebook.meta.get("tcn", "")), codebook.symmetry or ObjectSymmetry()

    @property
    def density(self) -> str:
        """Size of the codebook, as a phrase."""
        return f"codebook of {len(self.poses):,} poses, for the paper's filter"

    def with_codebook(self, codebook: Codebook) -> PaperObject:
        """Return the same object with another codebook, for `PaperFilter.take`."""
        return PaperObject(codebook)


class PaperFilter:
    """Distribution of the sensor pose `T_obj_gel`, with the interface of `ParticleFilter` except for its belief.

    Args: mesh; codebook of that mesh; config; clock, which returns seconds, for the milliseconds per stage in `Status`;
    threads, of the compiled kernels (0: one per core); limits of the state. The paper has no state: here it follows
    from mass and spread of the heaviest hypothesis.
    """

    def __init__(
        self,
        mesh: ObjectMesh,
        codebook: Codebook,
        config: PaperConfig | None = None,
        clock: Callable[[], float] = lambda: 0.0,
        threads: int = 0,
        limits: FilterConfig | None = None,
    ):
        self.config, self._limits = config or PaperConfig(), limits or FilterConfig()
        self._workers = Workers(threads)
        # a turn by w is the quaternion (w / 2, 1), normalised
        self._noise = np.repeat([self.config.noise_translation, 0.5 * self.config.noise_rotation], 3).astype(np.float32)
        self.object = PaperObject(codebook)
        # the paper prunes by the vertices, which are dense on its meshes; other meshes need points of the surface
        count = int(np.clip(mesh.area / _SURFACE_SPACING**2, 1_000, _MOST_SURFACE_POINTS))
        self._surface = KDTree(mesh.sample_surface(count, np.random.default_rng(0))[0].astype(np.float32))
        self._clock = clock
        self.reset(0)

    def reset(self, seed: int) -> None:
        """Forget everything except object and settings."""
        self._rng = np.random.default_rng(seed)
        # seeded once, one per range of particles, so that noise does not depend on the number of threads
        self._streams = [kernels.NormalStream(each) for each in self._rng.integers(2**63, size=CHUNKS).tolist()]
        self._state = StateMachine(self._limits)
        self._particles: Particles | None = None
        self._spread: float | None = None
        self.modes: list[Mode] = []
        self._in_contact = False

    def initialise_uniform(self) -> None:
        """Start at codebook poses drawn over the whole surface."""
        entries = uniform_entries(len(self.object.poses), self.config.n_start, self._rng)
        self._start(Particles.from_poses(self.object.poses[entries], entries))

    def initialise_gaussian(self, prior: np.ndarray, sigma_t: float, sigma_r: float) -> None:
        """Start around a prior `T_obj_gel` (4, 4) with sigma_t [m] and sigma_r [rad] per axis, and move each particle
        to its nearest codebook pose."""
        drawn = gaussian_poses(prior, sigma_t, sigma_r, self.config.n_start, self._rng)
        self._start(Particles.from_poses(drawn, np.zeros(len(drawn))))
        self._to_codebook()

    def _start(self, particles: Particles) -> None:
        self._particles, self._spread, self.modes = particles, None, []

    def take(self, prepared: PaperObject) -> None:
        """Switch to another codebook of the object."""
        self.object = prepared

    def force_update(self) -> None:
        """Do nothing: every touch counts in full."""

    def deferred_update(self, in_time: InTime = always) -> None:
        """Do nothing: a step leaves no work."""

    def step(
        self,
        odometry: np.ndarray | None,
        measurement: Measurement,
        others: Mapping[str, Measurement] | None = None,
        elapsed: float | None = None,
    ) -> Estimate:
        """Run one step of section 4.3: motion, measurement update, pruning, clustering, annealing, resampling.

        odometry: `inv(p_prev) p_now` (4, 4), None on the first frame. others and elapsed are ignored. Raises
        InputError if the code cannot be used.
        """
        watch = Stopwatch(self._clock)
        if self._particles is None:
            self._state.update(StateEvidence())
            return Estimate([], Status(self._state.state, self._state.reason))
        self._in_contact, code = measurement.in_contact, self._code(measurement)
        with watch.stage("motion"):
            if odometry is not None:
                self._propagate(Odometry.from_matrix(odometry))
        with watch.stage("lookup"):
            self._particles.entries = self.object.tree.query(_six_vectors(self._particles))[1].astype(np.int32)
        with watch.stage("weights"):
            weights = self._weights_of(code)
        with watch.stage("modes"):
            self.modes = self._hypotheses(weights)
        with watch.stage("resampling"):
            kept = self._anneal(weights)
            ancestors = kernels.systematic(weights[kept], len(kept), self._rng.random())
            self._particles = self._particles.select(kept[ancestors])
        return self._report(watch)

    def _propagate(self, motion: Odometry) -> None:
        """Move every particle by the odometry, then by its own noise (equation 1)."""
        p = self._particles
        self._workers.run(
            len(p),
            lambda low, high, chunk: kernels.compose(
                low, high, p.positions, p.quaternions, motion.row, self._noise, self._streams[chunk]
            ),
        )

    def _code(self, measurement: Measurement) -> np.ndarray:
        """Return the measured code (D,); without contact, a random one (appendix C)."""
        length = self.object.codes.shape[1]
        if not measurement.in_contact or measurement.code is None:
            return self._rng.standard_normal(length, dtype=np.float32)
        require_network([measurement], self.object.network_id)
        code = np.asarray(measurement.code, np.float32).ravel()
        if len(code) != length or not np.isfinite(code).all() or not code.any():
            raise InputError(f"tactile code: not {length} finite numbers that differ from 0")
        return code

    def _weights_of(self, code: np.ndarray) -> np.ndarray:
        """Return the softmax of the cosines (equation 2), with 0 for particles off the surface (appendix C)."""
        cosine = (self.object.codes @ (code / np.linalg.norm(code)))[self._particles.entries].astype(float)
        weights = np.exp(cosine - cosine.max())
        distance = self._surface.query(self._particles.positions)[0]
        weights[distance > self.config.prune_distance] = 0.0
        if not weights.any():  # the text leaves this open; as at the start, touches are at codebook poses
            self._to_codebook()
            weights[:] = 1.0
        return weights / weights.sum()

    def _to_codebook(self) -> None:
        entries = self.object.tree.query(_six_vectors(self._particles))[1].astype(np.int32)
        self._particles = Particles.from_poses(self.object.poses[entries], entries)

    def _hypotheses(self, weights: np.ndarray) -> list[Mode]:
        """Cluster the positions by DBSCAN; each mode has a cluster's mean position and Markley's mean rotation.

        All particles in a cell of a third of eps are one weighted point: all pairs of particles of a narrow
        distribution would not fit into memory.
        """
        from sklearn.cluster import DBSCAN  # large, and needed only here

        p = self._particles
        cells = np.floor(p.positions * (_CELLS_PER_EPS / self.config.eps)).astype(np.int64)
        cells -= cells.min(axis=0)
        index = np.ravel_multi_index(tuple(cells.T), cells.max(axis=0) + 1)
        _, cell, count = np.unique(index, return_inverse=True, return_counts=True)
        centres = np.stack([np.bincount(cell, p.positions[:, k]) for k in range(3)], axis=1) / count[:, None]
        clustering = DBSCAN(eps=self.config.eps, min_samples=self.config.min_samples)
        label = clustering.fit(centres, sample_weight=count).labels_[cell]
        mass = np.bincount(label[label >= 0], weights[label >= 0])
        order = np.argsort(-mass, kind="stable")
        return [_mode(p, weights, np.flatnonzero(label == k)) for k in order if mass[k] > 0]

    def _anneal(self, weights: np.ndarray) -> np.ndarray:
        """Return indices (n,) of the particles to keep: without the lightest, or with copies of the heaviest, as the
        spread of the hypotheses has shrunk or grown (appendix C)."""
        n = len(weights)
        order = np.argsort(-weights, kind="stable")
        spread = np.mean([np.sqrt(np.diag(m.covariance)[:3]).mean() for m in self.modes]) if self.modes else None
        ratio = spread / self._spread if spread and self._spread else 1.0
        self._spread = spread
        wanted = int(np.clip(round(n * ratio), self.config.n_least, self.config.n_start))
        return order[np.arange(wanted) % n] if wanted > n else np.sort(order[:wanted])

    @property
    def identity(self) -> tuple[np.ndarray, float]:
        """As of `ParticleFilter`; it never considers another object."""
        return np.ones(1), 0.0

    @property
    def poses(self) -> np.ndarray:
        """Particles `T_obj_gel` (N, 4, 4); N = 0 while uninitialised."""
        return self._particles.poses if self._particles else np.empty((0, 4, 4))

    @property
    def weights(self) -> np.ndarray:
        """Weights (N,), all the same: each step ends with resampling."""
        return self._particles.weights if self._particles else np.empty(0)

    def _report(self, watch: Stopwatch) -> Estimate:
        dominant = self.modes[0] if self.modes else None
        mass = dominant.weight if dominant else 0.0
        spread_t = dominant.spread_translation if dominant else 0.0
        spread_r = dominant.spread_rotation if dominant else 0.0
        state, reason = self._state.update(
            StateEvidence(True, self._in_contact, mode_mass=mass, error_t=spread_t, error_r=spread_r)
        )
        n = len(self._particles)
        status = Status(state, reason, n, float(n), len(self.modes), mass, spread_t, spread_r, ms=watch.ms)
        return Estimate(self.modes, status, dominant.covariance if dominant else None)


def _six_vectors(particles: Particles) -> np.ndarray:
    """Return (N, 6) float32: position and alpha times the log of the rotation (section 4.2)."""
    log = Rotation.from_quat(particles.quaternions).as_rotvec()
    return np.concatenate([particles.positions, ROTATION_SCALE * log], axis=1).astype(np.float32)


def _mode(particles: Particles, weights: np.ndarray, which: np.ndarray) -> Mode:
    """Return mean and covariance of the particles with indices `which` (n,).

    The mean rotation is Markley's (2007): the eigenvector of the largest eigenvalue of the mean of q q^T.
    """
    mass = weights[which].sum()
    w = weights[which] / mass
    t, q = particles.positions[which].astype(float), particles.quaternions[which].astype(float)
    mean = np.linalg.eigh(q.T @ (w[:, None] * q))[1][:, -1]
    turned = Rotation.from_quat(q) * Rotation.from_quat(mean).inv()
    offset = np.concatenate([t - w @ t, turned.as_rotvec()], axis=1)
    pose = se3.from_xyzquat(np.append(w @ t, mean)[None])[0]
    return Mode(float(mass), pose, offset.T @ (w[:, None] * offset), len(which))


def uniform_entries(n_entries: int, n: int, rng: np.random.Generator) -> np.ndarray:
    """Draw n codebook entries (n,), ascending, over the whole surface, which the codebook covers evenly.

    Stratified: how often two entries are drawn differs by one at most.
    """
    rounds = -(-n // n_entries)
    return np.sort(np.concatenate([rng.permutation(n_entries) for _ in range(rounds)])[:n])


def gaussian_poses(centre: np.ndarray, sigma_t: float, sigma_r: float, n: int, rng: np.random.Generator) -> np.ndarray:
    """Draw n poses (n, 4, 4) around `centre` (4, 4) with sigma_t [m] and sigma_r [rad] per axis (paper section 4.3).

    They lie off the surface; the paper then replaces each by the nearest pose of the codebook.
    """
    noise = np.concatenate([sigma_t * rng.standard_normal((n, 3)), sigma_r * rng.standard_normal((n, 3))], axis=1)
    rotations = se3.exp(noise * [0, 0, 0, 1, 1, 1])[:, :3, :3]
    return se3.make(centre[:3, :3] @ rotations, centre[:3, 3] + noise[:, :3])
