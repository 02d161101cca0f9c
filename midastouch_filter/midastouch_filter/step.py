"""One step of the filter: what odometry and touches do to a belief (paper section 4.3 and appendix C), and its answer.

Move the particles by the odometry, weigh them by the measured codes, resample if the weights have become too uneven,
find the modes, and let the measured maps refine them. How each part works is said by `policies.py`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from midastouch_common import se3
from midastouch_perception.symmetry.search import ObjectSymmetry

from .core.belief import Belief
from .core.config import FilterConfig
from .core.estimate import Estimate, Mode
from .core.fingers import FIRST, Finger, count
from .core.gates import Gates, Stopwatch
from .core.motion_model import Odometry, OdometryJump
from .core.particles import Particles
from .core.pose_hypothesis import another
from .core.resampling import effective_size
from .core.state import StateEvidence, StateMachine, Status
from .core.touch import Measurement
from .policies import Policies


class Outcome(NamedTuple):
    """The fingers that measured something new; whether any touches; why the step started again, in words, "" if not."""

    measured: list[Finger]
    in_contact: bool
    restarted: str


class Step:
    """Applies the policies to a belief, one after the other.

    Args: policies; particles, number of them after a restart; gates; watch.
    """

    def __init__(self, policies: Policies, particles: int, gates: Gates, watch: Stopwatch):
        self._policies, self._particles, self._gates, self._watch = policies, particles, gates, watch

    def __call__(
        self,
        belief: Belief,
        odometry: np.ndarray | None,
        touches: Mapping[str, Measurement],
        elapsed: float | None,
    ) -> Outcome:
        """Change the belief; touches: of all fingers, by name, the first one's among them; else as
        `ParticleFilter.step`."""
        policies, in_contact = self._policies, any(touch.in_contact for touch in touches.values())
        self._gates.note = self._restarted = ""
        self._gates.skips("no_contact", not in_contact)
        better = self._correct(belief, odometry, touches[FIRST], elapsed)
        motion = self._propagate(belief, better, in_contact)
        measured = policies.fingers.measure(touches, motion, belief.explained)
        policies.refine.moved(motion, policies.fingers.path, in_contact)
        touching = [finger for finger in measured if finger.touch.in_contact]
        tempering = self._update(belief, measured, touching[0]) if touching else 0.0
        with self._watch.stage("modes"):
            belief.cluster()
        if policies.refine(belief, measured, tempering):
            policies.reweigh.trend.explained()
        return Outcome(measured, in_contact, self._restarted)

    def _correct(
        self, belief: Belief, odometry: np.ndarray | None, touch: Measurement, elapsed: float | None
    ) -> np.ndarray | None:
        """The odometry without what is known to be wrong with it; says so when the object moved."""
        better, jump = self._policies.correct(odometry, touch, elapsed), self._policies.correct.jump
        if jump is not None:
            distance, angle = np.linalg.norm(jump.moved[:3, 3]), se3.rotation_angle(jump.moved[:3, :3])
            reason = f"the object moved by {1e3 * distance:.1f} mm, {math.degrees(angle):.1f} deg"
            self._gates.refuse("object_moved", reason)
            self._policies.propagate.blur(belief.particles, jump.covariance)
        return better

    def _propagate(self, belief: Belief, odometry: np.ndarray | None, in_contact: bool) -> Odometry | None:
        """Equation 1; starts again after a jump. The motion, None if nothing moved."""
        with self._watch.stage("motion"):
            try:
                motion = self._policies.propagate(belief.particles, odometry, in_contact)
            except OdometryJump as jump:
                self._restart(belief, self._policies.source.uniform(self._particles), "odometry_jump", str(jump))
                return None
            if motion is not None:
                belief.moved(motion.path)
            return motion

    def _update(self, belief: Belief, measured: list[Finger], touching: Finger) -> float:
        """Equation 2 and resampling; the largest tempering exponent of the fingers that touch, `touching` the first."""
        policies = self._policies
        with self._watch.stage("lookup"):
            codebook_distance = belief.look_up()
        with self._watch.stage("weights"):
            alive = policies.reweigh(belief, measured, codebook_distance)
            tempering = count(measured)
            policies.propagate.explore(belief.dominant_mass, tempering)
        with self._watch.stage("resampling"):
            if alive:
                replaced = policies.recover.fraction(policies.reweigh.trend)
                policies.resample(belief)
                policies.recover(belief, touching, replaced)
            else:
                particles = policies.source.matches_and_uniform(touching, self._particles)
                reason = "no particle can explain the touch; started again over the surface"
                self._restart(belief, particles, "restarted", reason)
        return tempering

    def _restart(self, belief: Belief, particles: Particles, kind: str, reason: str) -> None:
        """Start again from these particles; kind: what it counts as; reason in words."""
        self._restarted = reason
        self._gates.refuse(kind, reason)
        belief.restart(particles)
        self._policies.restart()


class Reporter:
    """Turns the belief, and what the policies know besides, into an estimate and its status; symmetry of the object."""

    def __init__(
        self, config: FilterConfig, policies: Policies, symmetry: ObjectSymmetry, gates: Gates, watch: Stopwatch
    ):
        self._symmetry, self._alike = symmetry.describe(), "" if symmetry.exact.trivial else symmetry.exact.describe()
        self._differ = another(symmetry.exact)
        self._state, self._policies, self._gates, self._watch = StateMachine(config), policies, gates, watch

    def nothing(self) -> Estimate:
        """The estimate before a start was given."""
        self._state.update(StateEvidence())
        return Estimate([], self._status(None))

    def estimate(self, belief: Belief, outcome: Outcome) -> Estimate:
        """The estimate after a step."""
        published = self._policies.refine.published(belief)
        first = published.modes[0]
        # else particles follow another hypothesis than the most probable one; what is split in two is still one
        followed = not self._differ(first.pose[None], belief.answers[0].pose)[0]
        dominant = belief.modes[0] if followed else first
        self._state.update(
            StateEvidence(
                initialised=True,
                in_contact=outcome.in_contact,
                support=self._policies.reweigh.trend.support,
                restarted=outcome.restarted,
                doubt=self._policies.refine.doubt if followed else "its particles follow another hypothesis",
                listed=published.listed,
                unknown=self._policies.refine.unknown,
                mode_mass=first.weight,
                spread_t=dominant.spread_translation,
                spread_r=dominant.spread_rotation,
                error_t=first.spread_translation,
                error_r=first.spread_rotation,
                alike=self._alike,
            )
        )
        status = self._status(belief, len(published.modes), replace(dominant, weight=first.weight))
        return Estimate(published.modes, status, published.covariance, self._policies.correct.calibration)

    def _status(self, belief: Belief | None, count: int = 0, dominant: Mode | None = None) -> Status:
        skipped, note = dict(self._gates.counts), self._gates.note
        reason = f"{self._state.reason} ({note})" if note else self._state.reason
        if belief is None or dominant is None:
            return Status(self._state.state, reason, skipped=skipped, symmetry=self._symmetry)
        return Status(
            state=self._state.state,
            reason=reason,
            n_particles=len(belief.particles),
            ess=effective_size(belief.weights),
            n_modes=count,
            mode_mass=dominant.weight,
            spread_t=dominant.spread_translation,
            spread_r=dominant.spread_rotation,
            likelihood_trend=self._policies.reweigh.trend.short,
            skipped=skipped,
            ms=self._watch.ms,
            symmetry=self._symmetry,
            foreign=self._state.foreign,
        )
