"""Fixed-lag re-evaluation: would another place on the object explain the last touches just as well?

A particle filter forgets: a place that lost its particles to a few noisy touches is never asked again, and one narrow
mode is left that looks certain. So a window of keyframes is kept. Every now and then the places that explain them best
by their codes are looked for over the whole codebook, and each of these rivals as well as the filter's own modes is
aligned to the kept penetration maps, one after the other along the path. The marginal likelihoods, and the start's
prior as long as the start lies in reach, give the odds between them.

That takes a hundred alignments, so it is done in slices, a few in every step of the filter.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from midastouch_perception import se3

from .alignment import PenetrationAlignment
from .config import FilterConfig
from .effort import Effort
from .keyframes import KeyframeWindow
from .lookup import PoseLookup
from .noise_model import NoiseModel
from .places import Place, Prior
from .replay import Replay
from .rival_search import RivalSearch
from .touch import Measurement


@dataclass(frozen=True)
class Comparison:
    """places, best first; exhaustive: no further place was within reach of the best by its codes; unrivalled: all
    places but the best are refuted."""

    places: list[Place]
    exhaustive: bool
    unrivalled: bool


class Reevaluation:
    """Keeps the last touches and compares the best places by them.

    Args: lookup; poses (M, 4, 4) of its entries; alignment; config; noise; effort.
    """

    def __init__(
        self,
        lookup: PoseLookup,
        poses: np.ndarray,
        alignment: PenetrationAlignment,
        config: FilterConfig,
        noise: NoiseModel,
        effort: Effort,
    ):
        self._alignment, self._noise, self._effort = alignment, noise, effort
        self._tempering = min(1.0, config.hindsight_spacing / noise.touch_correlation)
        self._search = RivalSearch(lookup, poses, self._tempering, noise, effort)
        self._window = KeyframeWindow(config.hindsight_touches, config.hindsight_spacing, effort.shortlist)
        self.restart(None)

    def restart(self, prior: Prior | None) -> None:
        """Forget all touches; `prior` is what is known of the present pose, if anything."""
        self._window.restart()
        self._begin(prior)

    def _begin(self, prior: Prior | None) -> None:
        self._prior = prior
        self._since, self._patience = self._effort.fewest, self._effort.anew
        self._running: Iterator[Comparison | None] | None = None

    def moved(self, transform: np.ndarray, path: float, in_contact: bool = True) -> None:
        """The first gel moved by `transform` (4, 4), which counts as `path` [m]."""
        self._window.moved(transform, path, in_contact)

    def contradicted(self) -> None:
        """The last touches fit the belief badly: forget those from before the sensor was lifted, if it was.

        The object may have been moved meanwhile, and touches that no one place explains would hide the new one.
        """
        if self._window.forget_before_lift():
            self._begin(None)

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

    @property
    def rests(self) -> bool:
        """Whether none is under way, and another one is not worth it yet because the last ones found no rival."""
        return self._running is None and self._effort.anew <= self._since < self._patience

    def compare(self, modes: list[np.ndarray]) -> Comparison | None:
        """Do a slice; what was found once it is complete, else None.

        modes: poses (4, 4) of the filter's own modes at present. All of them are among the places, the refuted ones
        with the odds of `NoiseModel.refuted` or less; the others are their rivals.
        """
        if len(modes) > 1:
            self._patience = self._effort.anew
        if self._running is None:
            if len(self._window) < self._effort.fewest or self._since < self._effort.anew:
                return None
            self._since = 0
            self._running = self._run(modes)
        found = next(self._running)
        if found is not None:
            self._running = None
            self._patience = min(2 * self._patience, self._effort.rarely) if found.unrivalled else self._effort.anew
        return found

    def _run(self, modes: list[np.ndarray]) -> Iterator[Comparison | None]:
        keyframes = list(self._window.keyframes)
        to_newest = se3.inverse(self._window.motion) @ keyframes[-1].motion
        starts = [mode @ to_newest for mode in modes]
        rivals, exhaustive = yield from self._search.find(keyframes, starts)
        replay = Replay(keyframes, self._alignment, self._tempering, self._noise, self._effort)
        for start in starts + rivals:
            yield from replay.follow(start)
        places = replay.places(self._window.motion, self._prior)
        refuted = all(place.log_odds <= self._noise.refuted for place in places[1:])
        yield Comparison(places, exhaustive, exhaustive and refuted)
