"""Comparison of a belief with the touches of one keyframe: alignment of hypotheses, its order, and their gain.

Codes propose, maps decide. Every untested pose gains its code's evidence at once. Then hypotheses are aligned to
the keyframe's maps, the heaviest first, and after them the untested poses with the largest weights, which thereby
become hypotheses. This is done in slices; a pose that is not reached in time keeps its code's evidence. A hypothesis
can no longer matter, and is not aligned, if even a map that it explains entirely would leave it too far behind.

A map's evidence is absolute, a code's is relative to a random pose. The poses that were first tested at this keyframe
bring both to one scale: those with the worst codes stand for the untested ones (docs/method.md).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from .alignment import Alignments, Sighting
from .belief import BEHIND, Belief, Hypotheses
from .gates import Gates
from .noise_model import NoiseModel
from .touch import Measurement

_OFF_SURFACE = 0.02  # m: a gel this far from every entry can touch nothing; 1 rad counts as 10 mm
_SEEN = 64  # hypotheses whose sightings are kept
_DESCENTS, _DESCENTS_AGAIN = 4, 2  # most of a freshly tested pose, and of a hypothesis that was aligned before
_ENOUGH = 8  # freshly tested poses from which the gain of an untested one can be estimated


class Comparison:
    """Comparison of a belief with the touches of all fingers at one keyframe.

    Args: belief, whose poses are those of this frame; touches, at least one, each with code and map; log_ratios, of
    each touch at the entries of each object; weights (F,) in [0, 1], how much of an independent touch each is;
    negligible, fraction of the weight that untested poses may keep; most, number of untested poses that are tested,
    None for all; odometer [m], its reading; changed, whether the object may have been moved since the last keyframe;
    noise; gates, which count.

    Attributes: done; paused, whether `most` untested poses were tested and further ones matter; seen, sightings by this
    frame's maps of the hypotheses that were aligned first, by their numbers.
    """

    def __init__(
        self,
        belief: Belief,
        touches: Sequence[Measurement],
        log_ratios: Sequence[Sequence[np.ndarray]],
        weights: np.ndarray,
        negligible: float,
        most: int | None,
        odometer: float,
        changed: bool,
        noise: NoiseModel,
        gates: Gates,
    ):
        self._belief, self._touches, self._log_ratios = belief, touches, log_ratios
        self._weights, self._negligible, self._left, self._noise, self._gates = weights, negligible, most, noise, gates
        self._odometer, self._changed, self.done, self.paused = odometer, changed, False, False
        self.seen: dict[int, Sighting] = {}
        hypotheses = belief.hypotheses
        self._known = n = len(hypotheses)  # later ones are freshly tested
        self._by_maps = belief.objects[0].alignment is not None
        self._prior = hypotheses.log_weights.copy()
        self._gain: np.ndarray = np.full(n, np.nan)
        self._fresh_gain: list[float] = []
        self._fresh_code: list[float] = []
        self._code: np.ndarray = np.full(n, np.nan)
        self._queue = np.argsort(-self._prior, kind="stable")
        for number, some in enumerate(belief.untested):
            if len(some):
                some.log_weights = some.log_weights + self._of_untested(number)

    # ------------------------------------------------------------------ codes

    def _of_untested(self, number: int) -> np.ndarray:
        """Return the codes' nats (n,) for each untested pose on an object; a gel off the surface gets the least."""
        some, lookup = self._belief.untested[number], self._belief.objects[number].lookup
        out = np.zeros(len(some))
        for touch, of_object, weight in zip(self._touches, self._log_ratios, self._weights, strict=True):
            log_ratio = weight * of_object[number]
            if touch.T_gel_finger is None:
                distance = lookup.follow(some)
                out += np.where(distance < _OFF_SURFACE, log_ratio[some.entries], log_ratio.min())
            else:
                out += self._of_poses(number, some.poses, touch, log_ratio)
        return out

    def _of_poses(self, number: int, poses: np.ndarray, touch: Measurement, log_ratio: np.ndarray) -> np.ndarray:
        there = poses if touch.T_gel_finger is None else poses @ touch.T_gel_finger
        entries = self._belief.objects[number].lookup.exact(there, within=_OFF_SURFACE)
        return np.append(log_ratio, log_ratio.min())[entries].astype(float)

    def _codes(self, index: np.ndarray) -> np.ndarray:
        """Return the codes' nats (n,) for hypotheses of an index (n,)."""
        hypotheses, unknown = self._belief.hypotheses, index[np.isnan(self._code[index])]
        for number in np.unique(hypotheses.objects[unknown]):
            some = unknown[hypotheses.objects[unknown] == number]
            self._code[some] = self._of_all(int(number), hypotheses.poses[some])
        return self._code[index]

    def _of_all(self, number: int, poses: np.ndarray) -> np.ndarray:
        """Return the nats (n,) of all fingers' codes for poses (n, 4, 4) on an object."""
        every = zip(self._touches, self._log_ratios, self._weights, strict=True)
        codes = [self._of_poses(number, poses, touch, weight * each[number]) for touch, each, weight in every]
        return np.sum(codes, axis=0)

    # ------------------------------------------------------------------ slices

    def work(self, count: int) -> int:
        """Align up to `count` hypotheses, and return after how many descents. Sets `done` once nothing that matters is
        left."""
        aligned = descents = 0
        while aligned < count and not (self.done or self.paused):
            index = self._next(count - aligned)
            if len(index):
                descents += self._align(index)
                aligned += len(index)
            else:
                self.paused = self._left == 0 and self._matter
                self.done = not self.paused
        if aligned or self.done or self.paused:
            self._weigh()
        return descents

    def extend(self, count: int) -> None:
        """Test up to `count` further poses, if any matter: while the gel is held still, there is time for it."""
        if self.paused:
            self._left, self.paused = count, False

    def _next(self, count: int) -> np.ndarray:
        """Return the hypotheses (n,) to align next; none if no further one matters."""
        while len(self._queue):
            index, self._queue = self._queue[:count], self._queue[count:]
            within = self._prior[index] + self._most_gain >= self._bound
            if (hopeless := index[~within]).size:
                self._gain[hopeless] = 0.0  # too far behind, whatever the maps would give
                self._gates.count("hopeless", len(hopeless))
            if within.any():
                return index[within]
        return self._promoted(count)

    @property
    def _bound(self) -> float:
        """Log-weight, with the gain, below which a hypothesis is dropped."""
        known = ~np.isnan(self._gain)
        if not known.any():
            return -math.inf
        return float((self._prior[known] + self._gain[known]).max()) + BEHIND

    @property
    def _most_gain(self) -> float:
        if self._by_maps:
            return float(self._weights.sum() * self._noise.residual_evidence(0.0))
        every = zip(self._log_ratios, self._weights, strict=True)
        return float(sum(weight * max(each.max() for each in of_touch) for of_touch, weight in every))

    def _promoted(self, count: int) -> np.ndarray:
        """Turn the heaviest untested poses into hypotheses, if untested ones matter; return their numbers (n,)."""
        self._weigh()
        belief, hypotheses = self._belief, self._belief.hypotheses
        count = count if self._left is None else min(count, self._left)
        if count <= 0 or not self._matter:
            return np.empty(0, int)
        log_weights = np.concatenate([some.log_weights for some in belief.untested])
        least = hypotheses.log_weights.max() + BEHIND if len(hypotheses) else -math.inf
        count = min(count, len(log_weights))
        best = np.argpartition(-log_weights, count - 1)[:count]
        best = np.sort(best[log_weights[best] > least])
        starts = np.cumsum([0, *map(len, belief.untested)])
        for number in range(len(belief.objects)):
            rows = best[(best >= starts[number]) & (best < starts[number + 1])] - starts[number]
            if len(rows):
                self._promote(number, rows)
        if self._left is not None:
            self._left -= len(best)
        self._gates.count("promoted", len(best))
        return np.arange(len(belief.hypotheses) - len(best), len(belief.hypotheses))

    @property
    def _matter(self) -> bool:
        """True while untested poses hold more of the weight than they may keep."""
        return any(map(len, self._belief.untested)) and self._belief.untested_mass >= self._negligible

    def _promote(self, number: int, rows: np.ndarray) -> None:
        some = self._belief.untested[number]
        rows = rows[np.argsort(-some.log_weights[rows], kind="stable")]
        taken = self._belief.take(number, rows)
        poses = taken.poses
        code = self._of_all(number, poses)
        prior = taken.log_weights - code  # the map's evidence replaces the code's
        born = Hypotheses.at(poses, self._noise.between_entries, prior, number, self._odometer)
        self._belief.hypotheses = self._belief.hypotheses.joined(born)
        self._prior = np.append(self._prior, prior)
        self._gain = np.append(self._gain, np.full(len(rows), np.nan))
        self._code = np.append(self._code, code)

    def _believe_codes(self, index: np.ndarray) -> None:
        """Take the codes as the evidence for hypotheses of an index (n,), because there are no maps."""
        belief, between = self._belief, self._noise.between_entries
        code = self._gain[index] = self._codes(index)
        covariances, fit = belief.hypotheses.covariances.copy(), belief.hypotheses.fit.copy()
        # a pose that the codes support is known as well as a codebook's best entry
        wide = np.trace(covariances[index] - between, axis1=1, axis2=2) > 0
        covariances[index[wide & (code > 0)]] = between
        # probability that the touches are no outliers
        fit[index] = 1.0 - belief.objects[0].measurement.outlier / np.exp(code / len(self._touches))
        belief.hypotheses = replace(belief.hypotheses, covariances=covariances, fit=fit)

    # ------------------------------------------------------------------ maps

    def _align(self, index: np.ndarray) -> int:
        """Align hypotheses of an index (n,) to the maps; return the number of descents, without maps that of poses."""
        if not self._by_maps:
            self._believe_codes(index)
            return len(index)
        hypotheses = self._belief.hypotheses
        poses, covariances, fit = hypotheses.poses.copy(), hypotheses.covariances.copy(), hypotheses.fit.copy()
        descents = 0
        for number in np.unique(hypotheses.objects[index]):
            some = index[hypotheses.objects[index] == number]
            found = self._aligned(int(number), some, hypotheses)
            self._gain[some] = self._noise.residual_evidence(1.0 - found.fits) @ self._weights
            descents += int(found.descents.sum())
            poses[some], covariances[some], fit[some] = found.poses, found.covariances, found.fits.min(axis=1)
            if len(self.seen) < _SEEN:
                self.seen.update(zip(some.tolist(), found.sightings(), strict=True))
        self._belief.hypotheses = replace(hypotheses, poses=poses, covariances=covariances, fit=fit)
        if (fresh := index[index >= self._known]).size:
            self._fresh_gain.extend(self._gain[fresh])
            self._fresh_code.extend(self._code[fresh])
        self._gates.count("descents", descents)
        return descents

    def _aligned(self, number: int, index: np.ndarray, hypotheses: Hypotheses) -> Alignments:
        """Return the alignments of hypotheses on one object, ended early for one that can no longer matter."""
        bound, needed = self._bound, None
        if math.isfinite(bound) and (least := self._weights.min()) > 0:
            # gain needed of the finger that counts least, if all others were explained entirely
            gain = (bound - self._prior[index] - self._most_gain) / least + self._noise.residual_evidence(0.0)
            needed = np.clip(1.0 - self._noise.residual_of(gain), 0.0, 1.0)
        fresh = bool(index[0] >= self._known)
        return self._belief.objects[number].alignment.align_each(
            hypotheses.poses[index],
            hypotheses.covariances[index],
            self._touches,
            needed,
            _DESCENTS if fresh else _DESCENTS_AGAIN,
            fresh,
        )

    # ------------------------------------------------------------------ weights

    def _weigh(self) -> None:
        """Set the weights of all hypotheses by the alignments so far."""
        known = ~np.isnan(self._gain)
        log_weights = self._prior.copy()
        log_weights[known] += self._gain[known] - self._level(known)
        waiting = np.flatnonzero(~known)
        log_weights[waiting] += self._codes(waiting)
        self._belief.hypotheses = replace(self._belief.hypotheses, log_weights=log_weights)

    def support(self, number: int) -> float:
        """Return the touches' nats for an object, against none of the known ones; 0 without a hypothesis on it."""
        hypotheses = self._belief.hypotheses
        own = np.flatnonzero(hypotheses.objects == number)
        if not len(own):
            return 0.0
        code = self._codes(own[[np.argmax(hypotheses.log_weights[own])]])[0]
        before = own[own < self._known]
        contradicted = 0.0
        if len(before) and not self._changed:
            led = before[np.argmax(self._prior[before])]
            contradicted = float(not np.isnan(self._gain[led]) and hypotheses.fit[led] <= self._noise.explained)
        return float(self._noise.object_evidence(code, self._weights.max() * contradicted))

    def _level(self, known: np.ndarray) -> float:
        """Return the nats that maps give a random pose."""
        if not self._by_maps or not known.any():
            return 0.0
        if len(self._fresh_gain) >= _ENOUGH:
            gains = np.array(self._fresh_gain)
            worst = np.argsort(self._fresh_code, kind="stable")[: max(len(gains) // 2, _ENOUGH)]
            # among the untested there may always be one more that fits as well as the best so far (Laplace)
            among = np.append(gains[worst], self._gain[known].max())
            return float(np.logaddexp.reduce(among) - math.log(len(among)))
        best = np.flatnonzero(known)[[int(np.argmax(self._gain[known]))]]
        return float((self._gain[best] - self._codes(best))[0])
