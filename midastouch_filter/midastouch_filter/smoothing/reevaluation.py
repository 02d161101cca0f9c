"""Fixed-lag re-evaluation: would another place on the object explain the last touches just as well?

A particle filter forgets: a place that lost its particles to a few noisy touches is never asked again, and one narrow
mode is left that looks certain. So a window of keyframes is kept. At each new one the places that explain them best by
their codes are looked for over the whole codebook, and each of these rivals as well as the filter's own modes is
aligned to the kept penetration maps, one after the other along the path. How well they fit, and the start's prior, give
the probability of each place; that the object was moved meanwhile, untold, is one of the explanations.

That takes dozens of alignments, so it is done in slices, a few in every step of the filter.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from midastouch_common import se3

from ..core.alignment import PenetrationAlignment, transform_covariance
from ..core.config import FilterConfig
from ..core.keyframes import KeyframeWindow
from ..core.lookup import PoseLookup
from ..core.noise_model import Effort, NoiseModel
from ..core.places import ANOTHER, APART, Place, Prior, distinct, pose_distance
from ..core.touch import Measurement
from .replay import Race, Replay, place_posterior
from .rival_search import Rivals, RivalSearch, Scored

_SAMPLE = 2048  # entries that the mean density of a prior is taken over


@dataclass(frozen=True)
class Comparison:
    """places, most probable first; elsewhere: probability that it is none of them; exhaustive: no further place was
    within reach of the best by its codes; cloud (C, 4, 4), cloud_scores (C,): as `Rivals`, at present."""

    places: list[Place]
    elsewhere: float
    exhaustive: bool
    cloud: np.ndarray
    cloud_scores: np.ndarray

    def settled(self, certain: float) -> bool:
        """Whether one place is as probable as that, and none was left out."""
        return self.exhaustive and self.places[0].probability > certain

    def probability_at(self, pose: np.ndarray) -> float:
        """Of the place that a pose (4, 4) belongs to: the nearest one."""
        distance = pose_distance(pose, np.stack([place.pose for place in self.places]))
        nearest = int(distance.argmin())
        return self.places[nearest].probability if distance[nearest] <= APART else 0.0


class Reevaluation:
    """Keeps the last touches and compares the best places by them.

    Args: lookup; alignment; places: how many the object has; config; noise; effort.
    Attributes: lifted, whether the sensor was lifted since what the last comparison knew.
    """

    def __init__(
        self,
        lookup: PoseLookup,
        alignment: PenetrationAlignment,
        places: int,
        config: FilterConfig,
        noise: NoiseModel,
        effort: Effort,
    ):
        self._lookup, self._alignment, self._noise, self._effort = lookup, alignment, noise, effort
        self._count, self._explains = places, config.penetration_fit
        self._search = RivalSearch(lookup, noise, effort)
        self._window = KeyframeWindow(
            config.smoothing_touches, config.smoothing_spacing, noise.touch_correlation, effort.shortlist
        )
        self.restart(None)

    def restart(self, prior: Prior | None) -> None:
        """Forget all touches; `prior` is what is known of the present pose, if anything."""
        self._window.restart()
        self._prior = prior
        self._typical = 0.0  # log of the prior's mean density over all places
        if prior is not None:
            some = self._lookup.poses[:: max(len(self._lookup) // _SAMPLE, 1)]
            density = prior.log_density(some, self._noise.prior_floor)
            self._typical = float(np.logaddexp.reduce(density) - np.log(len(some)))
        self._since, self._patience, self.lifted = 0, self._effort.anew, False
        self._running: Iterator[Comparison | None] | None = None

    def score_anew(self, log_ratio_of: Callable[[Measurement], np.ndarray], places: int) -> None:
        """The look-up has other entries; arguments as of `KeyframeWindow.score_anew`, and of this."""
        self._running, self._count = None, places
        self._window.score_anew(log_ratio_of)

    def recall(self, felt: KeyframeWindow, log_ratio_of: Callable[[Measurement], np.ndarray]) -> None:
        """After a restart: know the touches of another window, and compare at once; as `KeyframeWindow.take`."""
        self._window.take(felt, log_ratio_of)
        self._since = len(self._window)

    def moved(self, transform: np.ndarray, path: float, in_contact: bool = True) -> None:
        """The first gel moved by `transform` (4, 4), which counts as `path` [m]."""
        self.lifted |= self._window.moved(transform, path, in_contact)

    @property
    def motion(self) -> np.ndarray:
        """(4, 4) of the first gel since the restart."""
        return self._window.motion

    @property
    def felt(self) -> np.ndarray:
        """(F, 4, 4) of the gels of the kept touches since the last lift, in the frame of the present first one."""
        since = [each for each in self._window.keyframes if each.stretch == self._window.stretch]
        gels = [gel for each in since for gel in each.gels]
        return se3.inverse(self._window.motion) @ np.stack(gels) if gels else np.empty((0, 4, 4))

    @property
    def due(self) -> bool:
        """Whether the present touch is worth keeping."""
        return self._window.due

    def keep(self, touches: list[Measurement], log_ratios: list[np.ndarray]) -> None:
        """Keep what the fingers feel at present, the first one first; at least one touch has a map.

        log_ratios: for each (M,), of every codebook entry.
        """
        self._window.keep(touches, log_ratios)
        self._since += 1
        if self._window.lifted:  # what is under way was asked before, of an object that may have been moved
            self._running, self._patience = None, self._effort.anew

    def rests(self, contradicted: bool) -> bool:
        """Whether none is under way, and another one is not worth it yet: the last ones said the same.

        contradicted: the present touch does not fit the belief.
        """
        if contradicted:
            self._patience = self._effort.anew
        return self._running is None and (self._since < self._patience or len(self._window) < self._effort.fewest)

    def compare(self, modes: list[np.ndarray]) -> Comparison | None:
        """Do a slice; what was found once it is complete, else None.

        modes: poses (4, 4) of the filter's own modes at present. All of them are among the places; the others are their
        rivals.
        """
        if self._running is None:
            self._since = 0
            self._running = self._run(modes)
        found = next(self._running)
        if found is not None:
            self._running, self.lifted = None, False
            most = self._effort.rarely if found.settled(self._noise.settled) else self._effort.seldom
            self._patience = min(2 * self._patience, most)
        return found

    def _run(self, modes: list[np.ndarray]) -> Iterator[Comparison | None]:
        window = Scored.of(list(self._window.keyframes), self._noise)
        newest = window.keyframes[-1].motion
        to_newest = se3.inverse(self._window.motion) @ newest
        starts = [mode @ to_newest for mode in modes]
        rivals = yield from self._search.find(window, starts)
        race = Race(window)
        replay = Replay(window, self._alignment, self._noise, self._effort, self._explains, race)
        asked = 0
        for start in starts + rivals.poses:
            if asked >= len(starts) and race.alignments >= self._effort.alignments:
                break
            asked += 1
            yield from replay.follow(start)
        yield self._compared(window, replay, rivals, asked - len(starts))

    def _compared(self, window: Scored, replay: Replay, rivals: Rivals, asked: int) -> Comparison:
        """Probabilities of all places that were followed, at present; `asked`, number of the rivals among them."""
        now, followed, every = self._window.motion, replay.followed, replay.evidence(self._search.along)
        onward = [se3.inverse(window.keyframes[each.at].motion) @ now for each in followed]
        poses = np.stack([each.pose @ on for each, on in zip(followed, onward, strict=True)])
        chosen = distinct(poses, np.argsort(-every.sum(axis=1), kind="stable"), ANOTHER)
        log_prior = np.full(len(chosen), -np.log(self._count))
        if self._prior is not None:
            starts = poses[chosen] @ se3.inverse(now)
            log_prior += self._prior.log_density(starts, self._noise.prior_floor) - self._typical
            # a start may be narrower than the object's places are apart
            log_prior -= max(float(np.logaddexp.reduce(log_prior)) + np.log(2.0), 0.0)
        # of an object with so many places only some are named; a broken motion may lead to any of them
        log_prior = np.append(log_prior, np.log(max(1.0 - np.exp(log_prior).sum(), 1.0 / self._count)))
        log_arrival = np.append(np.full(len(chosen), -np.log(self._count)), 0.0)
        share, elsewhere = place_posterior(every[chosen], log_prior, log_arrival, window.change)
        places = [
            Place(poses[i], transform_covariance(followed[i].covariance, onward[i]), float(p))
            for i, p in zip(chosen, share, strict=True)
        ]
        best = followed[chosen[int(share.argmax())]]
        # who explains all touches need not fear those that explain the last ones only
        exhaustive = asked >= (rivals.lasting if best.at == 0 else len(rivals.poses))
        places.sort(key=lambda place: -place.probability)
        on = se3.inverse(window.keyframes[-1].motion) @ now
        return Comparison(places, elsewhere, exhaustive, rivals.cloud @ on, rivals.cloud_scores)
