"""Keyframes of a belief: frames a few millimetres apart, at which every hypothesis that can still matter is compared.

A keyframe brings the belief to the present frame, adds poses if the gel was lifted, and weighs all poses by where
gels were in the air. The comparison then continues in slices, after the answer is out, until the next keyframe at the
latest. If the leading hypothesis explains too little of the touch, poses are born that allow for a moved object.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .alignment import Sighting
from .belief import Belief
from .births import Births
from .comparison import Comparison
from .config import FilterConfig
from .free_space import refute
from .gates import Gates, Stopwatch
from .measurement_model import log_ratios
from .noise_model import LEAST_UNKNOWN, MOST_UNKNOWN, NoiseModel
from .pace import InTime
from .touch import Measurement
from .track import Track

_SLICE = 32  # most hypotheses aligned in one call
_LONGEST = 0.05  # s: a longer time between frames counts as this
_AT_ONCE = 0.25  # fraction of a frame's work that is done even if no time is left: otherwise nothing is ever sure
_NEGLIGIBLE = 3e-3  # fraction of the weight that untested poses may keep
_UNTESTED_BEHIND = -16.3  # nats, relative to the heaviest: lighter untested poses are dropped; many together may matter
_RENEWED = 0.1  # fraction of the usual evidence that each keyframe renews


class Keyframes:
    """Comparison of one belief with the touches of its keyframes.

    Args: belief; track, of the first finger's gel; births; config; noise; gates, which count; watch, which times.
    """

    def __init__(
        self,
        belief: Belief,
        track: Track,
        births: Births,
        config: FilterConfig,
        noise: NoiseModel,
        gates: Gates,
        watch: Stopwatch,
    ):
        self._belief, self._track, self._births, self._config, self._noise = belief, track, births, config, noise
        self._gates, self._watch = gates, watch
        self._comparison: Comparison | None = None
        self._granted = 0
        self._usual: float | None = None

    def begin(self, touches: list[Measurement], gels: np.ndarray, in_air: Sequence[Measurement]) -> dict[int, Sighting]:
        """Make this frame a keyframe, and compare the leading hypotheses.

        touches, at least one, with gels (F, 4, 4) in the frame of the first finger's; in_air, fingers that touch
        nothing. Returns sightings by this frame's maps of the hypotheses that were aligned first, by their numbers;
        `go_on` adds further ones.
        """
        belief, noise, track, config = self._belief, self._noise, self._track, self._config
        self._finish()
        with self._watch.stage("codes"):
            belief.come_up(track.odometer, noise.drift)
            if track.lifted and noise.change_lifted > 0:
                self._gates.count("born", self._births.after_change(belief, noise.change_lifted))
            scored = [log_ratios([model.measurement for model in belief.objects], touch.code) for touch in touches]
            if not len(belief.hypotheses):
                self._births.of_finger(belief, gels[int(np.argmax([_information(each) for each in scored]))])
            beside = [each.T_gel_finger for each in in_air if each.T_gel_finger is not None]
            refute(belief, np.concatenate([track.free_space(), np.reshape(beside, (-1, 4, 4))]), noise)
            lifted, weights = track.lifted, track.keep(gels)
            most = config.tested_poses if config.alignments_per_second else None
            negligible = _NEGLIGIBLE if most else 0.0
            self._comparison = Comparison(
                belief, touches, scored, weights, negligible, most, track.odometer, lifted, noise, self._gates
            )
            self._gates.count("keyframes", 1)
        with self._watch.stage("align"):
            if len(belief.hypotheses):
                self._comparison.work(min(config.refined_modes, len(belief.hypotheses)))
        return self._comparison.seen

    def grant(self, elapsed: float | None) -> None:
        """Allow the work that goes with a frame `elapsed` [s] after the last one (None if unknown)."""
        rate = self._config.alignments_per_second
        if not rate:
            self._granted = 2**31
            return
        seconds = _LONGEST if elapsed is None else min(max(elapsed, 0.0), _LONGEST)
        self._granted += max(round(rate * seconds), 1)

    @property
    def waiting(self) -> bool:
        """True while work is left and allowed."""
        return self._comparison is not None and self._granted > 0

    def go_on(self, held: bool, in_time: InTime) -> bool:
        """Do the work that was granted, or less if no time is left; return whether the comparison is over.

        held: nothing moves, so there is time to test further poses.
        """
        comparison, at_once = self._comparison, self._granted * (1.0 - _AT_ONCE)
        if held:
            comparison.extend(self._granted)
        while self._granted > 0 and (self._granted > at_once or in_time()):
            self._granted -= max(comparison.work(min(_SLICE, self._granted)), 1)
            if comparison.done or comparison.paused:
                break
        self._granted = min(self._granted, 0)  # what a slice took too much is taken off the next frame
        if comparison.done:
            self._finish()
        return comparison.done

    def _finish(self) -> None:
        """End the comparison under way: poses that were not reached keep their codes' evidence."""
        if self._comparison is None:
            return
        belief, noise = self._belief, self._noise
        self._learn_of_objects(self._comparison)
        self._comparison, self._granted = None, 0
        belief.settle(_UNTESTED_BEHIND)
        if len(belief.hypotheses) and noise.change > 0 and self._contradicted():
            self._gates.count("born", self._births.after_change(belief, noise.change))

    def _learn_of_objects(self, comparison: Comparison) -> None:
        """Add the touches' evidence for each object to its support (docs/internals.md)."""
        belief = self._belief
        support = belief.support + [comparison.support(number) for number in range(len(belief.objects))]
        # limited, so that later touches can overturn earlier ones
        odds = max(self._config.unknown_prior / (1.0 - self._config.unknown_prior), 1e-3)
        least, most = (np.log(odds * (1.0 - unknown) / unknown) for unknown in (MOST_UNKNOWN, LEAST_UNKNOWN))
        belief.support = np.clip(support, least, most)

    def _contradicted(self) -> bool:
        """Return whether the last keyframe suggests a change: a pose that explained it as well as the leading one
        explained earlier keyframes would be as probable as the leading one, although changes are rare."""
        hypotheses = self._belief.hypotheses
        fit = float(hypotheses.fit[int(np.argmax(hypotheses.log_weights))])
        evidence = float(self._noise.residual_evidence(1.0 - fit))
        usual = evidence if self._usual is None else self._usual
        if fit < self._noise.explained or evidence < usual + np.log(self._noise.change):
            return True
        self._usual = usual + (evidence - usual) * _RENEWED
        return False


def _information(log_ratios: Sequence[np.ndarray]) -> float:
    """Return the information [nats] of a code about the pose, by its log-ratios at the entries of each object."""
    ratios = np.concatenate(log_ratios)
    return float((np.exp(ratios) * ratios).sum() / np.exp(ratios).sum())
