"""Where to touch next: slides ranked by what they are expected to tell about the pose, for what they cost.

The finger does not know where it is, so that it can only be given a motion relative to its gel: a heading, and how far.
Each hypothesis says where that would lead (`slide_prediction.py`) and what the touches on the way would say for it
(`expected_evidence.py`). With probabilities p and the evidence E(i, j) that speaks for i against j if i is right, the
information of a slide about the pose is that of a mixture (Kolchinsky and Tracey 2017),

    I = - sum_i p_i log sum_j p_j exp(-E(i, j)),

which lies between 0 and the entropy of p. Slides are ranked by information per metre, the best policy where more of
them follow. Poses of several objects may compete: then it is information about the object, too.
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
_PER_MOTION = 2  # touches on the shortest one: over an edge that it crosses there should be one
CLEARANCE = 0.01
"""m above the surface on the way of a lift, enough for the filter to know it from a gap in a slide."""


@dataclass(frozen=True)
class Wanted:
    """max_length [m] of a suggestion, None: the object's diagonal; lifts, whether they are allowed; count, at most."""

    max_length: float | None = None
    lifts: bool = False
    count: int = 3


@dataclass(frozen=True)
class Suggestion:
    """heading [rad] in the gel's plane, from its x to its y axis; length [m] along the surface; lift: no contact on the
    way; information [nats]; cost [m] of travel; reason, a sentence; path (n, 4, 4), gel poses on the object, by the
    most probable hypothesis that can go this way, the first where it is now; n = 0 where none on that object can."""

    heading: float
    length: float
    lift: bool
    information: float
    cost: float
    reason: str
    path: np.ndarray


@dataclass(frozen=True)
class Advice:
    """suggestions, best first; indistinguishable: hypotheses remain that nothing within reach can tell apart;
    message."""

    suggestions: list[Suggestion]
    indistinguishable: bool
    message: str


def advise(
    hypotheses: Sequence[Hypothesis], measured: np.ndarray, wanted: Wanted, noise: NoiseModel, on: str = ""
) -> Advice:
    """What to do next, given what is possible: hypotheses, most probable first, probabilities of sum 1.

    measured (F, 4, 4): gels that have touched since the last lift, in the frame of the present one. on: name of the
    object in whose frame paths are wanted.
    """
    outlook = _Outlook(hypotheses, measured, wanted, noise, on)
    suggestions = sorted(outlook.slides() + outlook.lifts(), key=lambda each: -each.information / each.cost)
    chosen = [each for each in suggestions if each.information > 0][: wanted.count]
    alike = outlook.alike()
    return Advice(chosen, bool(alike), _message(hypotheses, chosen, alike))


class _Outlook:
    """What every heading leads to, for H hypotheses, K headings and T touches on the way."""

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
        """Nats (H, K, T, H) of each touch, as `code_evidence`; of narrow hypotheses by their maps."""
        ways = self._tracks[:, :, 1:]
        flat = ways.reshape(len(ways), -1, 4, 4)
        # a narrow hypothesis is where it is; laid flat, two poses alike would no longer be carried to poses alike
        narrow = np.array([each.narrow for each in self._hypotheses])[:, None, None]
        starts = np.where(narrow, np.stack([each.pose for each in self._hypotheses]), self._tracks[:, 0, 0])
        poses = carried_along(starts, flat)
        evidence = code_evidence(self._hypotheses, poses)
        narrow = self._with_maps()
        for i in narrow:
            others = [j for j in narrow if j != i]
            evidence[i][:, others] = 0.0  # what tells two competitors apart does not tell which hypothesis is right
            others = others if i == 0 else [0]
            within_reach = self._touchable if self._wanted.lifts else self._slid
            some, against = np.flatnonzero(within_reach[i]), [self._hypotheses[j] for j in others]
            at = np.ix_([i], some, others)
            evidence[at] = map_evidence(self._hypotheses[i], against, flat[i, some], poses[at][0], self._noise)
        return evidence.reshape(*ways.shape[:3], -1)

    def _with_maps(self) -> list[int]:
        """Hypotheses whose maps can be compared, none if the most probable hypothesis is none of them, or the only
        one."""
        able = [k for k, each in enumerate(self._hypotheses) if each.narrow and each.model.alignment is not None]
        return able if able[:1] == [0] and len(able) > 1 else []

    def slides(self) -> list[Suggestion]:
        """The best one in each heading."""
        return self._best(self._by_slide, self._slid, self._distances, lift=False)

    def lifts(self) -> list[Suggestion]:
        """The best one in each heading, to where no slide leads."""
        if not self._wanted.lifts:
            return []
        beyond = self._touchable & ~self._slid
        return self._best(self._by_lift, beyond, self._distances + 2 * CLEARANCE, lift=True)

    def _best(self, evidence: np.ndarray, possible: np.ndarray, cost: np.ndarray, lift: bool) -> list[Suggestion]:
        """possible (H, K, T); what most of the belief would not let happen is not suggested."""
        likely = (np.tensordot(self._probability, possible, axes=1) > 0.5) & self._long_enough
        information = np.where(likely, mixture_information(self._probability, evidence), -1.0)
        out = []
        for k, t in enumerate(np.argmax(information / cost, axis=1)):
            if likely[k, t]:
                able = np.flatnonzero(possible[:, k, t] & self._drawn)[:1]  # of these the most probable
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
        """In words, by the two hypotheses that it tells apart best; evidence (H, H)."""
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
        """Hypotheses that compete with the most probable one and cannot be distinguished from it; none if that is no
        hindrance."""
        narrow = [k for k, each in enumerate(self._hypotheses) if each.narrow]
        if len(narrow) < 2:
            return []
        most = self._by_slide[:, :, -1].sum(axis=1)  # nearly nothing is touched by two of them
        if self._wanted.lifts:  # wherever the object is by then, touches there tell
            most = np.maximum(most, self._elsewhere.max(axis=(1, 2)))
        top = narrow[0]
        odds = np.log(self._probability[top] / self._probability)
        alike = [k for k in narrow if k == top or odds[k] + min(most[top, k], most[k, top]) < self._certain]
        mass, named = (sum(self._probability[k] for k in some) for some in (alike, narrow))
        sure = self._probability[top] / mass
        certain = self._hypotheses[0].model.config.converged_probability
        return [self._hypotheses[k] for k in alike] if sure < certain <= mass / named else []


def mixture_information(probability: np.ndarray, evidence: np.ndarray) -> np.ndarray:
    """Nats (...) about which of H hypotheses of a probability (H,) is right, by evidence (H, ..., H)."""
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
        return "no slide within reach tells anything; allow lifts, or a longer way"
    if len(narrow) > 1:
        return f"{len(narrow)} hypotheses compete: {', '.join(map(_called, narrow))}"
    return f"one hypothesis is left to be confirmed: {_called(narrow[0])}" if narrow else "no hypothesis stands out yet"


class Advisor:
    """Advises on what one filter touches, by what it takes for possible."""

    def __init__(self, running: ParticleFilter):
        self._running, self._noise = running, NoiseModel.of(running.config)

    @property
    def hypotheses(self) -> list[Hypothesis]:
        """What the belief takes for possible, most probable first; none before something was measured."""
        return hypotheses_of(self._running) if self._running.modes else []

    def advise(self, wanted: Wanted) -> Advice | None:
        """Where to touch next; None before something was measured."""
        running, hypotheses = self._running, self.hypotheses
        on = running.object.mesh.name if len(running.objects) > 1 else ""
        return advise(hypotheses, running.measured_gels, wanted, self._noise, on) if hypotheses else None
