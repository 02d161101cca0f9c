"""The particle filter over touch (paper section 4.3 and appendix C).

One step: move the particles by the odometry, look up their codebook entries, weigh them by the measured code,
resample if the weights have become too uneven, and report the modes.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

import midastouch_kernels as kernels
from midastouch_perception import se3
from midastouch_perception.errors import InputError
from midastouch_perception.mesh import ObjectMesh
from midastouch_perception.sensor_model import SensorModel

from . import gates, initialisation, kld, resampling
from .alignment import Aligned
from .belief import covariance_about
from .config import FilterConfig
from .estimate import Estimate, Mode, modes_from_moments
from .fingers import Evidence as FingerEvidence
from .fingers import Fingers
from .hindsight import CODE_MARGIN, Comparison, Felt, Hindsight, Place, Prior, pose_distance
from .joint_alignment import FeltPenetration
from .measurement_model import MeasurementModel
from .mode_masses import gained_together, with_odds
from .modes import ModeFinder
from .motion_model import Exploration, MotionModel, Odometry, carried
from .object_index import ObjectIndex
from .particles import Particles
from .recovery import LikelihoodTrend
from .refinement import Refinement, sharpened
from .regions import Regions
from .state import Evidence, StateMachine, Status
from .stopwatch import Stopwatch
from .surface import SurfaceConstraint
from .touch import FingerTouch, Measurement
from .workers import Workers

if TYPE_CHECKING:
    from midastouch_perception.codebook import Codebook

_SURPLUS = 2  # times the wanted particles, from which even weights are resampled, to save time


class ParticleFilter:
    """Distribution of the sensor pose `T_obj_gel` on a known object.

    Args: mesh; codebook of that mesh; config; seed: same seed and input, same machine, bit-equal result;
    clock: function returning seconds, for the milliseconds per stage in `Status` (default: none are measured);
    open_gates: names of gates of the reference, as in `Status.skipped`, that let everything pass, to see what they are
    worth.
    Raises InputError if the codebook cannot be used.
    """

    def __init__(
        self,
        mesh: ObjectMesh,
        codebook: Codebook,
        config: FilterConfig | None = None,
        seed: int = 0,
        clock: Callable[[], float] = lambda: 0.0,
        open_gates: Collection[str] = (),
    ):
        self._open_gates = tuple(open_gates)
        self.config = c = config or FilterConfig()
        _require_usable(codebook)
        self._network_id = str(codebook.meta.get("tcn", ""))
        self._workers = Workers(c.threads)
        index = ObjectIndex(mesh, codebook, c, self._workers)
        self._order, self._poses, self._lookup = index.order, index.poses, index.lookup
        self._measurement = MeasurementModel(codebook.codes[self._order], codebook.meta, self._lookup, c, self._workers)
        self._surface = SurfaceConstraint(index.surface, self._lookup.largest_gap, c, self._workers)
        self._fingers = Fingers(
            self._lookup, self._surface, c, self._workers, lambda: self._measurement.for_another_sensor()
        )
        self._regions = Regions(self._lookup, c.region_radius)
        self._mode_finder = ModeFinder(self._lookup, self._regions, c.mode_radius, c.min_mode_mass, self._workers)
        self._refinement = self._make_refinement(mesh, codebook) if c.refinement else None
        self._hindsight = None
        if self._refinement and c.hindsight:
            self._hindsight = Hindsight(self._lookup, self._poses, self._refinement.alignment, c)
        self._clock = clock
        self.reset(seed)

    def _make_refinement(self, mesh: ObjectMesh, codebook: Codebook) -> Refinement | None:
        sensor = codebook.meta.get("sensor")
        return Refinement(mesh, SensorModel.load(sensor), self.config, self._workers) if sensor else None

    def reset(self, seed: int) -> None:
        """Forget everything but object and settings: the filter is then as if made anew with this seed."""
        c = self.config
        self._rng = np.random.default_rng(seed)
        self._motion = MotionModel(c, self._rng, self._workers)
        self._gates = {
            "at_rest": gates.RestGate(c),
            "no_contact": gates.ContactGate(),
            "unchanged_code": gates.UnchangedCodeGate(),
            "effective_size": gates.EffectiveSizeGate(c),
            "whole_book": gates.OccupiedGate(),
            "unmoved_modes": gates.UnmovedGate(),
            "wide_modes": gates.WideGate(),
            "unrivalled": gates.UnrivalledGate(),
        }
        for name in self._open_gates:
            self._gates[name].open = True
        self._refused: Counter[str] = Counter()
        self._state = StateMachine(c)
        self._watch = Stopwatch(self._clock)
        self._note = self._restarted = ""
        self._particles: Particles | None = None
        self._path_since_touch = np.inf

    # ------------------------------------------------------------------ start

    def initialise_uniform(self) -> None:
        """Start over the whole surface, with uniform yaw: nothing is known."""
        entries = initialisation.uniform_entries(len(self._poses), self.config.max_particles, self._rng)
        self._start(self._around(entries), None)

    def initialise_gaussian(self, prior: np.ndarray, sigma_t: float, sigma_r: float) -> None:
        """Start around a prior `T_obj_gel` (4, 4): sigma_t [m], sigma_r [rad] per axis, projected to the surface.

        Raises InputError as `initialisation.checked_prior`.
        """
        prior = initialisation.checked_prior(prior, sigma_t, sigma_r)
        drawn = initialisation.gaussian_poses(prior, sigma_t, sigma_r, self.config.max_particles, self._rng)
        prior = Prior(prior, max(sigma_t, 1e-4), max(sigma_r, 1e-3))
        self._start(self._around(np.sort(self._lookup.exact(drawn))), prior)

    def _around(self, entries: np.ndarray) -> Particles:
        """Equally weighted particles at codebook entries (n,), spread over the gaps between them."""
        particles = Particles.from_poses(self._poses[entries], entries)
        self._motion.scatter(particles, self._lookup.spacing)
        return particles

    def _start(self, particles: Particles, prior: Prior | None) -> None:
        self._particles = particles
        self._checked = False
        self._fingers.restart()
        if self._hindsight:
            self._hindsight.restart(prior)
        self._weights = particles.weights
        self._trend = LikelihoodTrend(self.config, self._measurement.outlier)
        self._exploration = Exploration(self.config)
        self._modes: list[Mode] = []  # of the particles
        self._fitted: dict[int, Aligned] = {}  # those that the last penetrations fitted, and how
        self._fitted_to: set[str] = set()  # the fingers these penetrations are of
        self._answers: list[Mode] = []  # the same, sharpened by the penetration of the frame where it could be
        self._path_since_lookup = 0.0
        self._path_since_touch = np.inf
        self._in_contact = False
        self._gates["at_rest"].reset()
        self._gates["unchanged_code"].reset()

    def force_update(self) -> None:
        """Count the next touch in full, even if the arm rests or the code is the last one again."""
        self._path_since_touch = np.inf
        self._gates["unchanged_code"].reset()
        self._fingers.force_update()

    # ------------------------------------------------------------------ one step

    def step(
        self, odometry: np.ndarray | None, measurement: Measurement, others: Mapping[str, FingerTouch] | None = None
    ) -> Estimate:
        """One step of the filter; returns its estimate.

        odometry: motion of the sensor since the last step, `inv(p_prev) p_now` (4, 4); None on the first frame.
        others: what further fingers on the same object feel, by name, also while this one is in the air; any of them
        may be missing in any frame.
        Unusable odometry, codes or finger poses (not finite, wrong size, zero) are refused: the reason is in the
        status, the number of times in `Status.skipped`. Raises InputError if a code comes from another network than
        the codebook's. Without a start the state stays `uninitialised`.
        """
        others = dict(others or {})
        if "" in others:
            raise InputError("others: a further finger needs a name")
        for each in (measurement, *(other.measurement for other in others.values())):
            self._require_same_network(each)
        if others and not measurement.in_contact:
            others[""] = FingerTouch(np.eye(4), measurement)  # the reference is not inside the object
        self._watch = Stopwatch(self._clock)
        self._note = self._restarted = ""
        if self._particles is None:
            return self._report()

        in_contact = measurement.in_contact or any(other.measurement.in_contact for other in others.values())
        with self._watch.stage("motion"):
            moved = self._predict(odometry, in_contact)
        code = self._touch(measurement, moved)
        felt = self._fingers.feel(others, self._refuse)
        if self._hindsight and not moved:
            self._hindsight.moved(np.eye(4), self._fingers.path)
        self._in_contact = in_contact
        touched = code is not None or any(finger.code is not None for finger in felt)
        if touched:
            with self._watch.stage("lookup"):
                distance = self._look_up()
            share = self._evidence_share() if code is not None else 0.0
            with self._watch.stage("weights"):
                alive = self._weigh(code, distance, share, felt)
            share = max(share, self._fingers.count(felt))
            with self._watch.stage("resampling"):
                self._resample(code, felt) if alive else self._restart(code, felt)
        with self._watch.stage("modes"):
            self._find_modes(moved or touched)
        penetrations = self._penetrations(measurement.penetration if code is not None else None, felt)
        if penetrations:
            with self._watch.stage("refinement"):
                self._refine(penetrations, share)
            if self._hindsight:
                with self._watch.stage("hindsight"):
                    self._look_back(code, felt, penetrations)
        return self._report()

    def _predict(self, odometry: np.ndarray | None, in_contact: bool) -> bool:
        """Equation 1: move every particle by the odometry and its own noise. False if nothing moved."""
        if odometry is None:
            return False
        try:
            motion = Odometry.from_matrix(odometry)
        except ValueError as error:
            self._refuse("bad_odometry", str(error))
            return False
        if motion.distance > self.config.max_odometry_jump:
            self._refuse("odometry_jump", f"odometry jumped by {motion.distance:.2f} m")
            self._restarted = self._note
            self.initialise_uniform()
            return True
        motion = self._gates["at_rest"].motion(motion)
        if motion is None:
            return False
        self._motion.propagate(self._particles, motion, self._exploration.share if in_contact else 0.0)
        self._path_since_lookup += motion.path
        self._path_since_touch += motion.path
        self._fingers.travelled(motion.transform)
        if self._hindsight:
            self._hindsight.moved(motion.transform, motion.path, in_contact)
        return True

    def _touch(self, measurement: Measurement, moved: bool) -> np.ndarray | None:
        """The unit code to weigh the particles by, or None if there is nothing new to learn."""
        if self._gates["no_contact"].skips(measurement.in_contact):
            return None
        try:
            code = self._measurement.unit_code(measurement.code)
        except ValueError as error:
            self._refuse("bad_code", str(error))
            return None
        due = np.isinf(self._path_since_touch) or (moved and self._path_since_touch > 0)
        if not due or self._gates["unchanged_code"].skips(code):
            return None
        return code

    def _look_up(self) -> np.ndarray:
        """Set each particle's codebook entry; returns the pose distances (N,) [m] to it."""
        if self._path_since_lookup > self._lookup.reach:
            self._lookup.relocate(self._particles)
        self._path_since_lookup = 0.0
        if self.config.project_to_surface:
            self._surface.project(self._particles)
        return self._lookup.follow(self._particles)

    def _evidence_share(self) -> float:
        """How much of this touch counts, in [0, 1], and start measuring the path to the next one.

        Touches nearer together than the correlation length see nearly the same patch: they are no independent
        evidence, so they count in proportion to the path between them.
        """
        share = min(1.0, self._path_since_touch / self.config.correlation_length)
        self._path_since_touch = 0.0
        return share

    def _weigh(
        self, code: np.ndarray | None, codebook_distance: np.ndarray, share: float, felt: Sequence[FingerEvidence]
    ) -> bool:
        """Equation 2, as a log-likelihood ratio, and the surface constraint, of each finger and to the power its share.

        False if no particle survives.
        """
        particles = self._particles
        log_ratios = []
        for finger in felt:
            log_ratio = finger.log_ratio(particles)
            if finger.code is not None and finger.name in self._fitted_to:
                self._share_out(log_ratio)
            log_ratios.append(log_ratio)
        shares = [finger.share for finger in felt]
        touching = [finger.share for finger in felt if finger.code is not None]
        if code is not None:
            log_ratios.insert(0, self._log_ratio(code, codebook_distance))
            shares.insert(0, share)
            touching.append(share)
        evidence = sum(log_ratios)
        tempered = sum(share * log_ratio for share, log_ratio in zip(shares, log_ratios, strict=True))
        log_weights, weights = np.empty(len(particles)), np.empty(len(particles))
        likelihood, total = kernels.reweigh(particles.log_weights, evidence, tempered, log_weights, weights)
        self._trend.update(likelihood / len(touching), max(touching))
        self._exploration.update(self._modes[0].weight if self._modes else 0.0, max(touching))
        if not np.isfinite(total):
            return False
        particles.log_weights, self._weights = log_weights, weights
        return True

    def _log_ratio(self, code: np.ndarray, codebook_distance: np.ndarray) -> np.ndarray:
        """(N,) of each particle, for the reference's code."""
        particles = self._particles
        if self._gates["whole_book"].skips(len(particles), len(self._lookup)):
            self._measurement.score_occupied(code, particles)
        else:
            self._measurement.score_codebook(code)
        log_ratio = self._surface.log_weight(particles, codebook_distance)
        log_ratio += self._measurement.log_likelihood(particles)
        if "" in self._fitted_to:
            self._share_out(log_ratio)
        return log_ratio

    def _share_out(self, log_ratio: np.ndarray) -> None:
        """Let the code speak for all modes that the last penetration fitted as for one.

        Between them the penetrations decide, which tell more: a code's small errors are the same all along an edge, and
        would in time kill one of two places that feel alike.
        """
        if len(self._fitted) > 1:
            members = self._mode_finder.members(self._particles)
            parts = [np.flatnonzero(members == k) for k in self._fitted]
            gained_together(self._particles.log_weights, log_ratio, parts)

    def _resample(self, code: np.ndarray | None, felt: Sequence[FingerEvidence]) -> None:
        """Systematic resampling to as many particles as KLD sampling asks for, and injection after a collapse."""
        n = len(self._particles)
        injection = self._trend.injection
        crowded = n > _SURPLUS * self._wanted_count(self._particles.entries)
        effective = resampling.effective_size(self._weights)
        if not injection and not crowded and self._gates["effective_size"].skips(effective, n):
            return
        ancestors = resampling.systematic(self._weights, n, self._rng)
        wanted = self._wanted_count(self._particles.entries[ancestors])
        if wanted != n:
            ancestors = resampling.systematic(self._weights, wanted, self._rng)
        self._particles = self._particles.select(ancestors)
        self._weights = self._particles.weights
        if injection:
            if self._hindsight:
                self._hindsight.contradicted()
            where = self._rng.choice(len(ancestors), round(injection * len(ancestors)), replace=False)
            self._particles.replace(where, self._best_matches(code, felt, len(where)))
            self._refused["injected"] += len(where)

    def _wanted_count(self, entries: np.ndarray) -> int:
        """Number of particles that a distribution over the codebook like `entries` (n,) needs."""
        if not self.config.kld_sampling:
            return len(entries)
        return kld.adapted_count(self._regions.of_entry[entries], self.config)

    def _restart(self, code: np.ndarray | None, felt: Sequence[FingerEvidence]) -> None:
        """No particle can explain the touch: start again, half from its best matches, half over the surface."""
        n = self.config.max_particles
        uniform = initialisation.uniform_entries(len(self._poses), n - n // 2, self._rng)
        matches = self._best_matches(code, felt, n // 2)
        particles = self._around(np.concatenate([uniform, matches.entries]))
        self._refuse("restarted", "no particle can explain the touch; started again over the surface")
        self._restarted = self._note
        self._start(particles, None)
        self._in_contact = True

    def _best_matches(self, code: np.ndarray | None, felt: Sequence[FingerEvidence], n: int) -> Particles:
        """By the reference's code, or, if it felt nothing new, by the first other finger's that did."""
        if code is not None:
            self._measurement.score_codebook(code)
            return self._around(self._measurement.draw_matches(n, self._rng))
        finger = next(each for each in felt if each.code is not None)
        gels = self._around(finger.draw_matches(n, self._rng))
        matches = carried(gels, se3.inverse(finger.T_gel_finger), self._workers)
        self._lookup.relocate(matches)
        return matches

    def _find_modes(self, changed: bool) -> None:
        """Hypothesis clustering; skipped while the particles are those of the last step."""
        if self._modes and self._gates["unmoved_modes"].skips(changed):
            return
        self._modes = self._answers = modes_from_moments(self._mode_finder.find(self._particles, self._weights))
        self._fitted, self._fitted_to = {}, set()

    def _usable(self, felt: FeltPenetration) -> bool:
        """Whether the penetration is there and can be compared with rendered ones."""
        if felt.penetration is None or self._refinement is None:
            return False
        if felt.penetration.shape == self._refinement.shape and np.isfinite(felt.penetration).all():
            return True
        whose = f"finger {felt.name}: " if felt.name else ""
        self._refuse("bad_relief", f"{whose}penetration map is not finite or not of shape {self._refinement.shape}")
        return False

    def _penetrations(self, penetration: np.ndarray | None, felt: Sequence[FingerEvidence]) -> list[FeltPenetration]:
        """The usable ones of this frame; `penetration` is the reference's."""
        found = [FeltPenetration(penetration), *(finger.felt_penetration for finger in felt)]
        return [each for each in found if self._usable(each)]

    def _refine(self, penetrations: Sequence[FeltPenetration], share: float) -> None:
        """Let the penetrations place the particles of narrow modes."""
        finder = self._mode_finder
        penetrations = self._refinement.reached(self._modes, penetrations)
        aligned = {}
        if penetrations:
            members = finder.members(self._particles)
            aligned = self._refinement.apply(self._particles, members, self._modes, penetrations, share)
        if self._gates["wide_modes"].skips(not aligned):
            return
        aligned = {finder.peaks[k]: a for k, a in aligned.items() if a.fit > self.config.relief_fit}
        self._weights = self._particles.weights
        self._modes = modes_from_moments(finder.moments(self._particles, self._weights))
        self._fitted = {k: aligned[peak] for k, peak in enumerate(finder.peaks) if peak in aligned}
        self._fitted_to = {each.name for each in penetrations}
        if 0 in self._fitted:
            self._trend.explained()
        self._answers = [
            sharpened(mode, self._fitted[k]) if k in self._fitted else mode for k, mode in enumerate(self._modes)
        ]

    def _look_back(
        self, code: np.ndarray | None, felt: Sequence[FingerEvidence], penetrations: Sequence[FeltPenetration]
    ) -> None:
        """Keep the touch, and go on asking whether other places explain the last ones as well."""
        if self._hindsight.due:
            map_of = {each.name: each.penetration for each in penetrations}
            kept = [
                Felt(finger.log_ratio_of_codebook(), map_of.get(finger.name), finger.T_gel_finger)
                for finger in felt
                if finger.code is not None
            ]
            if code is not None:
                self._measurement.score_codebook(code)
                kept.insert(0, Felt(self._measurement.log_ratio, map_of.get("")))
            self._hindsight.keep(*kept)
        narrow = [mode for mode in self._modes if self._refinement.is_narrow(mode)]
        if not narrow or narrow[0] is not self._modes[0]:
            return
        if self._gates["unrivalled"].skips(len(narrow) == 1 and self._hindsight.rests):
            return
        comparison = self._hindsight.compare([mode.pose for mode in narrow[: self.config.refined_modes]])
        if comparison is not None:
            self._believe(comparison)

    def _believe(self, comparison: Comparison) -> None:
        """Give the modes the odds that the replay found, and rivals that have no particles some of their own."""
        places = comparison.places
        self._checked = True
        owners: list[int | None] = []
        for place in places:
            k = self._mode_at(place.pose)
            owners.append(None if k in owners else k)
        self._particles, new = with_odds(
            self._particles,
            self._mode_finder.members(self._particles),
            owners,
            np.array([place.log_odds for place in places]),
            lambda place, count: self._spread_around(places[place], count),
            rest=math.exp(-CODE_MARGIN) if comparison.exhaustive else 1.0,
        )
        self._refused["rivals"] += new
        self._weights = self._particles.weights
        self._find_modes(True)

    def _mode_at(self, pose: np.ndarray) -> int | None:
        """The mode nearest to a pose (4, 4), None if it is another place."""
        distance = [pose_distance(mode.pose, pose) for mode in self._modes]
        return int(np.argmin(distance)) if min(distance) < self.config.mode_radius else None

    def _spread_around(self, place: Place, count: int) -> Particles:
        """Particles spread as the place's covariance and the arm's jitter say."""
        noise = self._rng.multivariate_normal(np.zeros(6), place.covariance + self.config.jitter, count)
        poses = place.pose @ se3.exp(noise)
        return Particles.from_poses(poses, self._lookup.exact(poses))

    # ------------------------------------------------------------------ answers

    def mark_stale(self, reason: str) -> Status:
        """Say from outside that input has stopped, for the reason given; returns the status to publish."""
        self._state.mark_stale(reason)
        self._note = ""
        return self._status()

    @property
    def poses(self) -> np.ndarray:
        """Particles `T_obj_gel` (N, 4, 4) at this very frame, as `Estimate.modes`; N = 0 while uninitialised."""
        if self._particles is None:
            return np.empty((0, 4, 4))
        if not self._fitted:
            return self._particles.poses
        members = self._mode_finder.members(self._particles)
        return self._refinement.sharpened(self._particles, members, self._modes, self._fitted).poses

    @property
    def weights(self) -> np.ndarray:
        """Weights (N,), sum 1."""
        return self._weights if self._particles else np.empty(0)

    @property
    def codebook_indices(self) -> np.ndarray:
        """Codebook entry (N,) of each particle, as of the last touch."""
        return self._order[self._particles.entries] if self._particles else np.empty(0, np.int64)

    def _report(self) -> Estimate:
        if self._particles is None:
            self._state.update(Evidence())
            return Estimate([], self._status())
        dominant = self._modes[0]
        self._state.update(
            Evidence(
                initialised=True,
                in_contact=self._in_contact,
                support=self._trend.support,
                restarted=self._restarted,
                checked=self._checked or self._hindsight is None,
                mode_mass=dominant.weight,
                spread_t=dominant.spread_translation,
                spread_r=dominant.spread_rotation,
            )
        )
        return Estimate(self._answers, self._status(), self._covariance())

    def _covariance(self) -> np.ndarray:
        """Of the whole belief about the published pose."""
        members = self._mode_finder.members(self._particles)
        return covariance_about(self._answers[0], members, self._particles, self._weights)

    def _status(self) -> Status:
        skipped = {name: gate.skipped for name, gate in self._gates.items()} | dict(self._refused)
        reason = f"{self._state.reason} ({self._note})" if self._note else self._state.reason
        if self._particles is None:
            return Status(self._state.state, reason, skipped=skipped)
        dominant = self._modes[0] if self._modes else None
        return Status(
            state=self._state.state,
            reason=reason,
            n_particles=len(self._particles),
            ess=resampling.effective_size(self._weights),
            n_modes=len(self._modes),
            mode_mass=dominant.weight if dominant else 0.0,
            spread_t=dominant.spread_translation if dominant else 0.0,
            spread_r=dominant.spread_rotation if dominant else 0.0,
            likelihood_trend=self._trend.short,
            skipped=skipped,
            ms=self._watch.ms,
        )

    def _refuse(self, name: str, reason: str) -> None:
        self._refused[name] += 1
        self._note = reason

    def _require_same_network(self, measurement: Measurement) -> None:
        theirs = measurement.network_id
        if theirs and self._network_id and theirs != self._network_id:
            raise InputError(
                f"tactile code: from network {theirs}, but the codebook was built with {self._network_id};"
                " build the codebook with the encoder in use"
            )


def _require_usable(codebook: Codebook) -> None:
    """Raise InputError unless the book holds finite poses and as many codes."""
    poses, codes = np.shape(codebook.poses), np.shape(codebook.codes)
    if poses[1:] != (4, 4) or not poses[0]:
        raise InputError(f"codebook: poses of shape {poses}, not (entries, 4, 4); build it again")
    if len(codes) != 2 or not codes[1]:
        raise InputError(f"codebook: codes of shape {codes}, not (entries, length); build it again")
    if codes[0] != poses[0]:
        raise InputError(f"codebook: {codes[0]} codes for {poses[0]} poses; build it again")
    if not np.isfinite(codebook.poses).all():
        raise InputError("codebook: poses are not finite; build it again with `midastouch build-codebook`")
