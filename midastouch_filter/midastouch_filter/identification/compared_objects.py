"""The objects of a catalogue that touches are compared with: all of a small one; of a large one the most probable.

Which these are, the coarse index says by the same touches, before every comparison. So an object comes back as soon as
touches speak for it; until then its probability is part of `unknown`, like that of an object on which no hypothesis
fits.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ..core import workers
from ..core.config import FilterConfig
from ..core.keyframes import Keyframe, KeyframeWindow, WeighedWindow
from ..core.measurement_model import CodeScores, calibration
from ..core.noise_model import NoiseModel
from ..core.workers import Workers
from .catalogue import ROOM, Catalogue
from .coarse_index import CoarseIndex

_READ_PER_STEP = 12  # codebooks, some 6 ms each


class ComparedObjects:
    """As many objects of a catalogue as there is room for, at first the first ones.

    Attributes: numbers, in the catalogue, ascending; catalogue, of these only; scores, of their codes.
    """

    def __init__(self, catalogue: Catalogue, config: FilterConfig, noise: NoiseModel):
        self._whole, self._config, self._noise = catalogue, config, noise
        self._workers, self._index = Workers(config.threads), None
        numbers = catalogue.with_room(range(len(catalogue)))
        self._take(numbers, self._scores([catalogue.entries[number].codebook.codes for number in numbers]))
        if len(numbers) < len(catalogue):
            typical = [entry.typical for entry in catalogue.entries]
            self._index = CoarseIndex(typical, *calibration(catalogue.calibration, config))

    @property
    def names(self) -> set[str]:
        """Of these objects."""
        return {entry.name for entry in self.catalogue.entries}

    def choose(self, window: KeyframeWindow, held: Sequence[int]) -> Iterator[None]:
        """Take the objects that a window's touches speak for, and score its keyframes by their codes, in slices.

        held: numbers of objects that are to stay. So do others that leave room for all that are probable by their
        codes: to read codebooks and to score all touches anew takes as long as some comparisons. Raises InputError if
        a codebook cannot be read again.
        """
        if self._index is None:
            return
        chosen = self._whole.with_room(self._ranked(window.keyframes, held))
        if chosen == self.numbers:
            return
        codes: list[np.ndarray] = []
        for number in chosen:
            codes.append(self._whole.entries[number].codebook.codes)
            if len(codes) % _READ_PER_STEP == 0:
                yield None
        scores, anew = self._scores(codes), {}
        for keyframe in list(window.keyframes):
            anew[id(keyframe)] = keyframe, _scored(window, keyframe, scores)
            if len(anew) * len(scores.codes) % ROOM < len(scores.codes):  # as much as a new touch takes at most
                yield None
        # and what has been kept since
        window.keyframes = [
            anew[id(each)][1] if id(each) in anew else _scored(window, each, scores) for each in window.keyframes
        ]
        self._take(chosen, scores)
        self._forget_others()

    def _take(self, numbers: list[int], scores: CodeScores) -> None:
        self.numbers, self.catalogue, self.scores = numbers, self._whole.only(numbers), scores

    def _scores(self, codes: list[np.ndarray]) -> CodeScores:
        return CodeScores(np.concatenate(codes), self._whole.calibration, self._config, self._workers)

    def _ranked(self, keyframes: Sequence[Keyframe], held: Sequence[int]) -> list[int]:
        """All numbers: those held and those probable by their codes, then those that are here, then the others."""
        window = WeighedWindow.of(list(keyframes), self._noise)
        codes = np.array([self.scores.unit_code(each.touches[0].code) for each in keyframes])
        support = window.best_suffix(self._index.log_ratios(codes) * window.weights)
        order = np.argsort(-support, kind="stable")
        fraction = np.exp(support[order] - np.logaddexp.reduce(support))
        wanted, here = np.zeros((2, len(order)), bool)
        wanted[order[np.cumsum(fraction) - fraction < self._noise.settled]] = True
        wanted[list(held)], here[self.numbers] = True, True
        support[list(held)] = np.inf
        return np.lexsort((-support, ~(wanted | here), ~wanted)).tolist()

    def _forget_others(self) -> None:
        kept = set(self.numbers)
        for number, entry in enumerate(self._whole.entries):
            if number not in kept:
                entry.forget()
        workers.trim()


def _scored(window: KeyframeWindow, keyframe: Keyframe, scores: CodeScores) -> Keyframe:
    return window.scored(keyframe, [scores.log_ratio_of(touch) for touch in keyframe.touches])
