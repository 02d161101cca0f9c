"""Asks the belief of a filter where to touch next."""

from __future__ import annotations

from ..core.noise_model import NoiseModel
from ..filter import ParticleFilter
from .hypotheses import Hypothesis, hypotheses_of
from .suggestion import Advice, Wanted, advise


class Advisor:
    """Advises on one filter's object, by what the filter takes for possible."""

    def __init__(self, running: ParticleFilter):
        self._running, self._noise = running, NoiseModel.of(running.config)

    @property
    def hypotheses(self) -> list[Hypothesis]:
        """What the belief takes for possible, most probable first; none before something was felt."""
        running, belief = self._running, self._running.belief
        return hypotheses_of(belief, running.object, running.config) if belief is not None and belief.modes else []

    def advise(self, wanted: Wanted) -> Advice | None:
        """Where to touch next; None before something was felt."""
        hypotheses = self.hypotheses
        return advise(hypotheses, self._running.felt, wanted, self._noise) if hypotheses else None
