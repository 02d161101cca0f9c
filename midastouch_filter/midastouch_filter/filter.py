"""The particle filter over touch (paper section 4.3 and appendix C): from a start, by each touch, to an estimate.

What a touch does to the belief is in `step.py`; that gives the answer. Once it is out, `deferred_update` does what only
later ones need: compare hypotheses by the last touches, and learn about the arm.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from midastouch_common.mesh import ObjectMesh

from .core.belief import Belief
from .core.config import FilterConfig
from .core.estimate import Estimate, Mode
from .core.fingers import Finger, by_name
from .core.gates import Gates, Stopwatch
from .core.initialisation import checked_prior
from .core.keyframes import KeyframeWindow
from .core.noise_model import NoiseModel
from .core.object_model import ObjectModel
from .core.particles import Particles
from .core.pose_hypothesis import PoseHypothesis, Prior
from .core.state import CONVERGED
from .core.touch import Measurement
from .core.workers import Workers
from .policies import Policies, default_policies
from .smoothing.pace import InTime, always
from .step import Reporter, Step

if TYPE_CHECKING:
    from midastouch_perception.codebook import Codebook


class _Answered(NamedTuple):
    """What fingers measured in a step, the first one's touch, seconds since the step before, and whether the answer can
    be trusted."""

    measured: list[Finger]
    touch: Measurement
    elapsed: float | None
    trusted: bool


class ParticleFilter:
    """Distribution of the sensor pose `T_obj_gel` on a known object.

    Args: mesh; codebook of that mesh; config; seed: same seed and input, same machine, bit-equal result;
    clock: function returning seconds, for the milliseconds per stage in `Status` (default: none are measured);
    open_gates: names of gates, as in `Status.skipped`, that let everything pass, to see what they are worth;
    make_policies: as `default_policies`, for other parts of the step.
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
        make_policies: Callable[..., Policies] = default_policies,
    ):
        self.config = config or FilterConfig()
        self._workers, self._noise = Workers(self.config.threads), NoiseModel.of(self.config)
        self._object = ObjectModel(mesh, codebook, self.config, self._noise, self._workers)
        self._watch, self._open_gates, self._make_policies = Stopwatch(clock), tuple(open_gates), make_policies
        self.reset(seed)

    def reset(self, seed: int) -> None:
        """Forget everything but object and settings: the filter is then as if made anew with this seed."""
        rng, gates, watch = np.random.default_rng(seed), Gates(self._open_gates), self._watch
        self._policies = self._make_policies(self.config, self._noise, self._object, rng, gates, watch, self._workers)
        self._step = Step(self._policies, self.config.max_particles, gates, watch)
        self._reporter = Reporter(self.config, self._policies, self._object.symmetry, gates, watch)
        self._belief: Belief | None = None
        self._answered: _Answered | None = None
        self._untouched = False

    # ------------------------------------------------------------------ start

    def initialise_uniform(self) -> None:
        """Start over the whole surface, with uniform yaw: nothing is known."""
        self._start(self._policies.source.uniform(self.config.max_particles), None)
        self._untouched = True

    def initialise_gaussian(self, prior: np.ndarray, sigma_t: float, sigma_r: float) -> None:
        """Start around a prior `T_obj_gel` (4, 4): sigma_t [m], sigma_r [rad] per axis, projected to the surface.

        Raises InputError as `initialisation.checked_prior`.
        """
        prior = checked_prior(prior, sigma_t, sigma_r)
        particles = self._policies.source.gaussian(prior, sigma_t, sigma_r, self.config.max_particles)
        self._start(particles, Prior(prior, max(sigma_t, 1e-4), max(sigma_r, 1e-3)))

    def initialise_hypotheses(
        self, hypotheses: Sequence[PoseHypothesis], measured: KeyframeWindow | None = None
    ) -> None:
        """Start half at these hypotheses, each by its probability, half over the whole surface; at least one of them.

        measured: what the first finger has measured on the way to the present frame, if anything.
        """
        self._start(self._policies.source.hypotheses_and_uniform(hypotheses, self.config.max_particles), None)
        if measured is not None:
            self._policies.refine.recall(measured, self._object.measurement.log_ratio_of)

    def _start(self, particles: Particles, prior: Prior | None) -> None:
        self._answered, self._untouched = None, False
        self._reporter.nothing()  # what the state was before says nothing of this start
        self._belief = Belief(particles, self._object.lookup, self._object.mode_finder, self._object.symmetry.exact)
        self._policies.restart(prior)

    def force_update(self) -> None:
        """Count the next touch in full, even if the arm rests or the code is the last one again."""
        self._policies.fingers.force_update()

    def take(self, prepared: ObjectModel) -> None:
        """Go on by another codebook of the object, between two steps: belief and kept touches stay."""
        now = prepared.lookup.exact(self._object.lookup.poses)
        self._object.take(prepared)
        self._policies.fingers.use(self._object.measurement_of)
        self._policies.refine.score_anew(self._object.measurement.log_ratio_of, self._object.n_poses)
        if self._belief is not None:
            self._belief.follow_entries(now)

    # ------------------------------------------------------------------ one step

    def step(
        self,
        odometry: np.ndarray | None,
        measurement: Measurement,
        others: Mapping[str, Measurement] | None = None,
        elapsed: float | None = None,
    ) -> Estimate:
        """One step of the filter; returns its estimate.

        odometry: motion of the sensor since the last step, `inv(p_prev) p_now` (4, 4); None on the first frame.
        others: what further fingers on the same object measure, by name, also while this one is in the air; any of them
        may be missing in any frame.
        elapsed: seconds since the last step, to which the deferred work is limited in proportion; None: unknown, and
        nothing is learnt about the arm's clock.
        Unusable odometry, codes or finger poses (not finite, wrong size, zero) are refused: the reason is in the
        status, the number of times in `Status.skipped`. Raises InputError if a code comes from another network than
        the codebook's. Without a start the state stays `uninitialised`.
        Calling `deferred_update` in between is optional: a step first runs the deferred work, so the estimates are the
        same.
        """
        touches = by_name(measurement, others or {})
        self._object.require_same_network(touches.values())
        self.deferred_update()
        if self._belief is None:
            return self._reporter.nothing()
        if self._untouched:
            # wherever the sensor is, it will touch the surface somewhere
            odometry, self._untouched = None, not any(touch.in_contact for touch in touches.values())
        outcome = self._step(self._belief, odometry, touches, elapsed)
        estimate = self._reporter.estimate(self._belief, outcome)
        self._watch.restart()
        self._answered = _Answered(outcome.measured, measurement, elapsed, estimate.status.state == CONVERGED)
        return estimate

    def deferred_update(self, in_time: InTime = always) -> None:
        """Run the work that only later estimates need: best called between an answer and the next touch.

        What it takes is limited by the time since the last frame; by `in_time`, too, where a machine may be too slow:
        estimates then depend on that.
        """
        if self._answered is None:
            return
        last, self._answered = self._answered, None
        self._policies.refine.deferred_update(self._belief, last.measured, last.elapsed, in_time)
        self._policies.correct.observe(self._belief, last.touch, last.trusted)

    # ------------------------------------------------------------------ answers

    @property
    def poses(self) -> np.ndarray:
        """Particles `T_obj_gel` (N, 4, 4) at this very frame, as `Estimate.modes`; N = 0 while uninitialised."""
        return self._policies.refine.sharpened(self._belief).poses if self._belief else np.empty((0, 4, 4))

    @property
    def weights(self) -> np.ndarray:
        """Weights (N,), sum 1."""
        return self._belief.weights if self._belief else np.empty(0)

    @property
    def object(self) -> ObjectModel:
        """What is known of the object, by the codebook of now."""
        return self._object

    @property
    def belief(self) -> Belief | None:
        """The particles and their modes as the last step left them, to be read; None while uninitialised."""
        return self._belief

    @property
    def modes(self) -> list[Mode]:
        """What the last touches make possible, heaviest first, as `Estimate.modes`; none while uninitialised."""
        return self._policies.refine.published(self._belief).modes if self._belief else []

    @property
    def measured_gels(self) -> np.ndarray:
        """(F, 4, 4) of the gels of the last touches that are kept, in the frame of the present first one."""
        return self._policies.refine.measured_gels

    @property
    def codebook_indices(self) -> np.ndarray:
        """Codebook entry (N,) of each particle, as of the last touch."""
        return self._object.order[self._belief.particles.entries] if self._belief else np.empty(0, np.int64)
