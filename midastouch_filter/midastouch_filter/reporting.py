"""What a step answers, from what the filter believes."""

from __future__ import annotations

from .core.belief import Belief
from .core.config import FilterConfig
from .core.estimate import Estimate
from .core.gates import Gates
from .core.resampling import effective_size
from .core.state import Evidence, StateMachine, Status
from .core.stopwatch import Stopwatch
from .policies import Policies
from .step import Outcome


class Reporter:
    """Turns the belief, and what the policies know besides, into an estimate and its status."""

    def __init__(self, config: FilterConfig, policies: Policies, gates: Gates, watch: Stopwatch):
        self._state, self._do, self._gates, self._watch = StateMachine(config), policies, gates, watch

    def nothing(self) -> Estimate:
        """No start was given yet."""
        self._state.update(Evidence())
        return Estimate([], self._status(None))

    def estimate(self, belief: Belief, outcome: Outcome) -> Estimate:
        """Answer of a step."""
        dominant = belief.modes[0]
        self._state.update(
            Evidence(
                initialised=True,
                in_contact=outcome.in_contact,
                support=self._do.reweigh.trend.support,
                restarted=outcome.restarted,
                checked=self._do.refine.checked,
                mode_mass=dominant.weight,
                spread_t=dominant.spread_translation,
                spread_r=dominant.spread_rotation,
                error=belief.answers[0].spread_translation,
            )
        )
        return Estimate(belief.answers, self._status(belief), belief.covariance, self._do.correct.calibration)

    def _status(self, belief: Belief | None) -> Status:
        skipped, note = dict(self._gates.counts), self._gates.note
        reason = f"{self._state.reason} ({note})" if note else self._state.reason
        if belief is None:
            return Status(self._state.state, reason, skipped=skipped)
        dominant = belief.modes[0] if belief.modes else None
        return Status(
            state=self._state.state,
            reason=reason,
            n_particles=len(belief.particles),
            ess=effective_size(belief.weights),
            n_modes=len(belief.modes),
            mode_mass=dominant.weight if dominant else 0.0,
            spread_t=dominant.spread_translation if dominant else 0.0,
            spread_r=dominant.spread_rotation if dominant else 0.0,
            likelihood_trend=self._do.reweigh.trend.short,
            skipped=skipped,
            ms=self._watch.ms,
        )
