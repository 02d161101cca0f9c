"""Suggestions of where to touch next: slides ranked by their expected information about the pose per cost.

The finger does not know where it is, so a suggestion is a motion relative to its gel: a heading and a length.
Each hypothesis predicts where that leads (`slide_prediction.py`) and the evidence of the touches on the way
(`expected_evidence.py`). With probabilities p and the evidence E(i, j) that speaks for i against j if i is right, the
information of a slide about the pose is that of a mixture (Kolchinsky and Tracey 2017),

    I = - sum_i p_i log sum_j p_j exp(-E(i, j)),

which lies between 0 and the entropy of p. Slides are ranked by information per metre, the best policy if more of
them follow. If poses on several objects compete, it is information about the object, too.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..core.noise_model import NoiseModel
from ..filter import ParticleFilter
from .expected_evidence import by_model, carried_along, code_evidence, map_evidence
from .hypotheses import Hypothesis, hypotheses_of
from .slide_prediction import independence_on_the_way, predict_slides, touches_on_the_way

HEADINGS = 8
_PER_MOTION = 2  # touches on the shortest motion, so that one lies beyond an edge that it crosses
CLEARANCE = 0.01
"""m above the surface on the way of a lift: enough for the filter to distinguish it from a gap in a slide."""


@dataclass(frozen=True)
class Wanted:
    """Request for suggestions.

    Attributes
    ----------
    max_length
        Longest motion [m]; None for the object's diagonal.
    lifts
        True if the finger may leave the surface.
    count
        Largest number of suggestions.
    """

    max_length: float | None = None
    lifts: bool = False
    count: int = 3


@dataclass(frozen=True)
class Suggestion:
    """Suggested motion.

    Attributes
    ----------
    heading : [rad]
        In the gel's plane, from its x to its y axis.
    length : [m]
        Along the surface.
    lift
        True if there is no contact on the way.
    information : [nats]
        Expected.
    cost : [m]
        Travel.
    reason
        A sentence.
    path
        Gel poses (n, 4, 4) on one object, from the present one, by its most probable hypothesis that can go this way; n
        = 0 if none can.
    """

    heading: float
    length: float
    lift: bool
    information: float
    cost: float
    reason: str
    path: np.ndarray


@dataclass(frozen=True)
class Advice:
    """Answer to `Wanted`.

    Attributes
    ----------
    suggestions
        Best first.
    indistinguishable
        True if hypotheses remain that nothing within reach can distinguish.
    message
        A sentence.
    """

    suggestions: list[Suggestion]
    indistinguishable: bool
    message: str


def advise(
    hypotheses: Sequence[Hypothesis], measured: np.ndarray, wanted: Wanted, noise: NoiseModel, on: str = ""
) -> Advice:
    """Suggest what to do next, given hypotheses, most probable first, with probabilities of sum 1.

    measured (F, 4, 4): gels that have touched since the last lift, in the frame of the present one. on: name of the
    object in whose frame paths are wanted.
    """
    outlook = _Outlook(hypotheses, measured, wanted, noise, on)
    suggestions = sorted(outlook.slides() + outlook.lifts(), key=lambda each: -each.information / each.cost)
    chosen = [each for each in suggestions if each.information > 0][: wanted.count]
    alike = outlook.alike()
    return Advice(chosen, bool(alike), _message(hypotheses, chosen, alike))


class _Outlook:
    """Expected evidence in every heading, for H hypotheses, K headings and T touches on the way."""

    def __init__(
        self, hypotheses: Sequence[Hypothesis], measured: np.ndarray, wanted: Wanted, noise: NoiseModel, on: str
    ):
        self._hypotheses, self._wanted, self._noise = hypotheses, wanted, noise
        self._drawn = np.array([each.name == on for each in hypotheses])
        self._probability = np.array([each.probability for each in hypotheses])
        config = hypotheses[0].model.config
        doubt = 1.0 - config.converged_probability
        self._certain = math.log(config.converged_probability / doubt) if doubt else math.inf
        self._headings = 2 * np.pi * np.arange(HEADINGS) / HEADINGS
        length, shortest = wanted.max_length or hypotheses[0].model.mesh.diagonal, noise.touch_correlation
        self._distances = touches_on_the_way(length, shortest / _PER_MOTION)
        self._long_enough = self._distances >= min(shortest, length)
        self._tracks, self._touchable = self._predicted()
        self._slid = np.logical_and.accumulate(self._touchable, axis=2)
        evidence = self._evidence()
        news = independence_on_the_way(self._tracks, measured, noise.touch_correlation)
        self._by_slide = np.maximum(np.cumsum(evidence * (news * self._slid)[..., None], axis=2), 0.0)
        self._elsewhere = np.maximum(evidence, 0.0) * self._touchable[..., None]
        moved = noise.change_lifted
        self._by_lift = -np.log((1.0 - moved) * np.exp(-self._elsewhere) + moved)

    def _predicted(self) -> tuple[np.ndarray, np.ndarray]:
        shape = len(self._hypotheses), HEADINGS, len(self._distances) + 1
        tracks, touchable = np.empty((*shape, 4, 4)), np.empty(shape, bool)
        for model, group in by_model(self._hypotheses):
            starts = np.stack([self._hypotheses[i].pose for i in group])
            tracks[group], touchable[group] = predict_slides(model, starts, self._headings, self._distances)
        return tracks, touchable[:, :, 1:]

    def _evidence(self) -> np.ndarray:
        """Return the nats (H, K, T, H) of each touch, as `code_evidence`; between narrow hypotheses by their maps."""
        ways = self._tracks[:, :, 1:]
        flat = ways.reshape(len(ways), -1, 4, 4)
        # a narrow hypothesis is not laid flat: motions would no longer carry look-alikes to look-alikes
        narrow = np.array([each.narrow for each in self._hypotheses])[:, None, None]
        starts = np.where(narrow, np.stack([each.pose for each in self._hypotheses]), self._tracks[:, 0, 0])
        poses = carried_along(starts, flat)
        evidence = code_evidence(self._hypotheses, poses)
        compared = self._with_maps()
        for i in compared:
            others = [j for j in compared if j != i]
            evidence[i][:, others] = 0.0  # a touch that distinguishes two competitors does not show which one is right
            others = others if i == 0 else [0]
            within_reach = self._touchable if self._wanted.lifts else self._slid
            some, against = np.flatnonzero(within_reach[i]), [self._hypotheses[j] for j in others]
            at = np.ix_(np.array([i]), some, np.array(others))
            evidence[at] = map_evidence(self._hypotheses[i], against, flat[i, some], poses[at][0], self._noise)
        return evidence.reshape(*ways.shape[:3], -1)

    def _with_maps(self) -> list[int]:
        """Return the hypotheses whose maps can be compared; none if the most probable one is not among them, or is the
        only one."""
        able = [k for k, each in enumerate(self._hypotheses) if each.narrow and each.model.alignment is not None]
        return able if able[:1] == [0] and len(able) > 1 else []

    def slides(self) -> list[Suggestion]:
        """Return the best slide in each heading."""
        return self._best(self._by_slide, self._slid, self._distances, lift=False)

    def lifts(self) -> list[Suggestion]:
        """Return the best lift in each heading, to where no slide leads."""
        if not self._wanted.lifts:
            return []
        beyond = self._touchable & ~self._slid
        return self._best(self._by_lift, beyond, self._distances + 2 * CLEARANCE, lift=True)

    def _best(self, evidence: np.ndarray, possible: np.ndarray, cost: np.ndarray, lift: bool) -> list[Suggestion]:
        """Return the best motions that are possible (H, K, T) for more than half of the belief."""
        likely = (np.tensordot(self._probability, possible, axes=1) > 0.5) & self._long_enough
        information = np.where(likely, mixture_information(self._probability, evidence), -1.0)
        out = []
        for k, t in enumerate(np.argmax(information / cost, axis=1)):
            if likely[k, t]:
                able = np.flatnonzero(possible[:, k, t] & self._drawn)[:1]  # the most probable of them
                stops = [0, t + 1] if lift else range(t + 2)
                out.append(
                    Suggestion(
                        heading=math.remainder(self._headings[k], 2 * math.pi),
                        length=float(self._distances[t]),
                        lift=lift,
                        information=max(float(information[k, t]), 0.0),
                        cost=float(cost[t]),
                        reason=self._reason(evidence[:, k, t], self._distances[t], lift),
                        path=self._tracks[able, k][:, stops].reshape(-1, 4, 4),
                    )
                )
        return out

    def _reason(self, evidence: np.ndarray, distance: float, lift: bool) -> str:
        """Return the reason, which names the two hypotheses that a motion distinguishes best; evidence (H, H)."""
        p = self._probability
        narrow = [k for k, each in enumerate(self._hypotheses) if each.narrow]
        how = f"{'touched again' if lift else 'after'} {1e3 * distance:.0f} mm"
        if len(narrow) < 2:
            what = f"it shows whether {_called(self._hypotheses[0])} is right" if narrow else "the touches there differ"
            return f"{how} {'away ' if lift else ''}{what}"
        gain = np.outer(p, p) * (1.0 - np.exp(-evidence))
        gain = (gain + gain.T)[np.ix_(narrow, narrow)]
        a, b = np.unravel_index(int(np.argmax(gain)), gain.shape)
        pair = [_called(self._hypotheses[narrow[k]]) for k in sorted((a, b))]
        return f"{how} {'away ' if lift else ''}{pair[0]} differs from {pair[1]}"

    def alike(self) -> list[Hypothesis]:
        """Return the most probable hypothesis and those that cannot be distinguished from it; none unless these alone
        keep the answer uncertain."""
        narrow = [k for k, each in enumerate(self._hypotheses) if each.narrow]
        if len(narrow) < 2:
            return []
        most = self._by_slide[:, :, -1].sum(axis=1)  # two slides touch hardly any surface in common
        if self._wanted.lifts:  # a touch elsewhere is evidence even if the object has moved by then
            most = np.maximum(most, self._elsewhere.max(axis=(1, 2)))
        top = narrow[0]
        odds = np.log(self._probability[top] / self._probability)
        alike = [k for k in narrow if k == top or odds[k] + min(most[top, k], most[k, top]) < self._certain]
        mass, named = (sum(self._probability[k] for k in some) for some in (alike, narrow))
        sure = self._probability[top] / mass
        certain = self._hypotheses[0].model.config.converged_probability
        return [self._hypotheses[k] for k in alike] if sure < certain <= mass / named else []


def mixture_information(probability: np.ndarray, evidence: np.ndarray) -> np.ndarray:
    """Return the nats (...) about which of H hypotheses of probability (H,) is right, by evidence (H, ..., H)."""
    inner = np.log(np.exp(-evidence) @ probability)
    return -np.tensordot(probability, inner, axes=1)


def _called(hypothesis: Hypothesis) -> str:
    x, y, z = 1e3 * hypothesis.pose[:3, 3]
    where = f"({x:.0f}, {y:.0f}, {z:.0f}) mm"
    return f"{hypothesis.name + ' at ' if hypothesis.name else ''}{where} ({hypothesis.probability:.0%})"


def _message(hypotheses: Sequence[Hypothesis], suggestions: list[Suggestion], alike: list[Hypothesis]) -> str:
    narrow = [each for each in hypotheses if each.narrow]
    if alike:
        return f"nothing within reach can tell these hypotheses apart: {', '.join(map(_called, alike))}"
    if not suggestions:
        return "no slide within reach is informative; allow lifts, or longer slides"
    if len(narrow) > 1:
        return f"{len(narrow)} hypotheses compete: {', '.join(map(_called, narrow))}"
    return f"one hypothesis is left to be confirmed: {_called(narrow[0])}" if narrow else "no hypothesis stands out yet"


class Advisor:
    """Adviser on where one filter should touch next, by its belief."""

    def __init__(self, running: ParticleFilter):
        self._running, self._noise = running, NoiseModel.of(running.config)

    @property
    def hypotheses(self) -> list[Hypothesis]:
        """Poses that the belief holds for possible, most probable first; none before something was measured."""
        return hypotheses_of(self._running) if self._running.modes else []

    def advise(self, wanted: Wanted) -> Advice | None:
        """Suggest where to touch next; None before something was measured."""
        running, hypotheses = self._running, self.hypotheses
        on = running.object.mesh.name if len(running.objects) > 1 else ""
        return advise(hypotheses, running.measured_gels, wanted, self._noise, on) if hypotheses else None
