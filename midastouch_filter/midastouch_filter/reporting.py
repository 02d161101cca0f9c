"""What a step answers, from what the filter believes."""

from __future__ import annotations

from .arm_errors import Calibration
from .belief import Belief
from .config import FilterConfig
from .estimate import Estimate
from .gates import Gates
from .recovery import LikelihoodTrend
from .resampling import effective_size
from .state import Evidence, StateMachine, Status
from .stopwatch import Stopwatch


class Reporter:
    """Turns the belief into an estimate and its status."""

    def __init__(self, config: FilterConfig, gates: Gates, watch: Stopwatch):
        self._state, self._gates, self._watch = StateMachine(config), gates, watch

    def nothing(self) -> Estimate:
        """No start was given yet."""
        self._state.update(Evidence())
        return Estimate([], self.status(None, 0.0))

    def estimate(
        self,
        belief: Belief,
        trend: LikelihoodTrend,
        in_contact: bool,
        checked: bool,
        restarted: str,
        calibration: Calibration | None,
    ) -> Estimate:
        """Answer of a step; arguments as `Evidence` and `Estimate`."""
        dominant = belief.modes[0]
        self._state.update(
            Evidence(
                initialised=True,
                in_contact=in_contact,
                support=trend.support,
                restarted=restarted,
                checked=checked,
                mode_mass=dominant.weight,
                spread_t=dominant.spread_translation,
                spread_r=dominant.spread_rotation,
            )
        )
        return Estimate(belief.answers, self.status(belief, trend.short), belief.covariance, calibration)

    def stale(self, reason: str, belief: Belief | None, trend: float) -> Status:
        """Status when input has stopped."""
        self._state.mark_stale(reason)
        self._gates.note = ""
        return self.status(belief, trend)

    def status(self, belief: Belief | None, trend: float) -> Status:
        """Of the present state."""
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
            likelihood_trend=trend,
            skipped=skipped,
            ms=self._watch.ms,
        )
