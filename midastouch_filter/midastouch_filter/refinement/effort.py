"""How much time the fine stage takes, for how good an answer."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Effort:
    """Alignment of modes. starts: particles that a mode is aligned from beside its mean, if it is wider than codebook
    entries are apart.

    Re-evaluation. fewest: touches that it needs to say anything; anew: further touches after which it is
    worth another one; the next ones wait twice as long each, up to `seldom` while places compete, `rarely` once they do
    not. shortlist: best entries of each touch, of all fingers, that
    become candidates. These come from `sieve` touches, the newest and ever sparser ones before it, and are scored on
    them first, and the best kept of them on all. With several fingers, the best `turned` candidates are turned by the
    angles `turns` [rad] to where all fit: codebook entries are some 20 deg apart, which moves a further finger by
    centimetres. lookups_per_step of candidates and alignments_per_step bound what one step takes. Rivals are replayed
    as long as `alignments` are not used up; settled: touches after which a place's rotation is known well enough to say
    where further fingers are.
    """

    starts: int = 4
    fewest: int = 2
    anew: int = 1
    seldom: int = 4
    rarely: int = 12
    shortlist: int = 80
    sieve: int = 5
    kept: int = 120
    turned: int = 50
    turns: tuple[float, ...] = (np.radians(10.0), np.radians(5.0))
    lookups_per_step: int = 2500
    alignments: int = 500
    alignments_per_step: int = 30
    settled: int = 3
