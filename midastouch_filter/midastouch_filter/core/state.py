"""State of the filter: how far its answer can be trusted, and why. `CatalogueLocaliser` may lower `converged`."""

from __future__ import annotations

from dataclasses import dataclass, field

from .config import FilterConfig

UNINITIALISED = "uninitialised"
NO_CONTACT = "no_contact"
AMBIGUOUS = "ambiguous"
CONVERGED = "converged"
LOST = "lost"
STALE = "stale"
SEARCHING = "searching"
STATES = (UNINITIALISED, NO_CONTACT, AMBIGUOUS, CONVERGED, LOST, STALE, SEARCHING)
WAITING = "waiting"
"""State in the status of a frame whose answer is still to come; the filter itself is never in it."""

FOREIGN = 0.95
"""Probability of another object above which the filter is lost, until it is below `_OWN`."""
_OWN, _DOUBTED = 0.5, 0.3  # the latter: not converged above it
_FOUND = 2.0  # nats: a trend below 0 is lost, and found again above this
_LISTED = 0.9  # probability that the truth is among the published modes, below which the filter is searching


@dataclass(frozen=True)
class Status:
    """State of the filter after a step.

    Attributes
    ----------
    state, reason
        One of `STATES`, and one sentence.
    n_particles, ess, n_modes
        Number of particles, their effective number, number of modes.
    mode_mass
        Weight of the dominant mode.
    spread_t : [m]
    spread_r : [rad]
        Both are root mean squares within the dominant mode.
    likelihood_trend : [nats]
        Evidence of the last touches for the dominant mode, against one that barely explains them: below 0 it does not
        explain them.
    skipped
        Number of times that each gate saved work or refused input, by name.
    ms
        Milliseconds per stage, with the deferred work after the last answer.
    symmetry
        Phrase on the object's symmetry.
    unknown
        Probability that another object is touched.
    foreign
        True if the state is `lost` because another object is touched.
    """

    state: str
    reason: str
    n_particles: int = 0
    ess: float = 0.0
    n_modes: int = 0
    mode_mass: float = 0.0
    spread_t: float = 0.0
    spread_r: float = 0.0
    likelihood_trend: float = 0.0
    skipped: dict[str, int] = field(default_factory=dict)
    ms: dict[str, float] = field(default_factory=dict)
    symmetry: str = ""
    unknown: float = 0.0
    foreign: bool = False


@dataclass(frozen=True)
class StateEvidence:
    """Input from which the state follows; units as in `Status`.

    trend: as `Status.likelihood_trend`; restarted: why the filter started again in this frame, "" if it did not;
    listed: probability that the truth is among the published modes; mode_mass: weight of the dominant mode; error_t
    [m], error_r [rad]: RMS distance and angle from the truth to the published pose, by its covariance, if its mode is
    the right one; unknown: probability that another object is touched; alike: phrase on how many poses feel the same as
    each one, empty if none do.
    """

    initialised: bool = False
    in_contact: bool = False
    trend: float = 0.0
    restarted: str = ""
    listed: float = 1.0
    mode_mass: float = 0.0
    error_t: float = 0.0
    error_r: float = 0.0
    unknown: float = 0.0
    alike: str = ""


class StateMachine:
    """State that follows from evidence, with hysteresis so that it does not flicker at a limit."""

    def __init__(self, config: FilterConfig):
        self._config = config
        self._lost = self._converged = self._foreign = False
        self.state, self.reason = UNINITIALISED, "no start given yet"

    @property
    def foreign(self) -> bool:
        """True while the state is `lost` because another object is touched."""
        return self.state == LOST and self._foreign

    def update(self, evidence: StateEvidence) -> tuple[str, str]:
        """Return the next state and its reason."""
        self.state, self.reason = self._next(evidence)
        return self.state, self.reason

    def _next(self, e: StateEvidence) -> tuple[str, str]:
        if not e.initialised:
            self._lost = self._converged = self._foreign = False
            return UNINITIALISED, "no start given yet"
        self._lost = bool(e.restarted) or e.trend < (_FOUND if self._lost else 0.0)
        self._foreign = e.unknown > (_OWN if self._foreign else FOREIGN)
        narrow, why_not = self._narrow(e)
        self._converged = narrow and not self._lost
        if not e.in_contact:
            return NO_CONTACT, "the sensor touches nothing; the last estimate moves with the arm"
        if self._foreign:
            return (LOST, f"these touches are not of this mesh: another object is, with {e.unknown:.1%} probability")
        if self._lost:
            return LOST, e.restarted or "the last touches contradict every hypothesis; looking for better ones"
        if self._converged:
            modulo = f", modulo symmetry: {e.alike}" if e.alike else ""
            return CONVERGED, f"one mode holds {e.mode_mass:.0%} within {1000 * e.error_t:.1f} mm{modulo}"
        if e.listed < _LISTED:
            return SEARCHING, f"{1 - e.listed:.0%} of the weight is on poses that no touch was compared with yet"
        return AMBIGUOUS, why_not

    def _narrow(self, e: StateEvidence) -> tuple[bool, str]:
        c = self._config
        slack = c.hysteresis if self._converged else 1.0
        if e.mode_mass < c.converged_probability:
            return False, f"the dominant mode holds {e.mode_mass:.0%} only"
        if e.error_t > c.converged_error * slack:
            return False, f"the published pose is known to {1000 * e.error_t:.1f} mm only"
        if e.error_r > c.converged_rotation * slack:
            return False, f"the published pose is known to {e.error_r:.2f} rad only"
        if e.unknown > _DOUBTED:
            return False, f"with a probability of {e.unknown:.0%} these touches are not of this mesh"
        return True, ""
