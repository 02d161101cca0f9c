"""Size the published regions: a split-conformal quantile over slides across training scans.

.venv/bin/python -m midastouch_benchmark.fits.regions --meshes ../shared/meshes/ycb [--slides 2] [--every 4]

Scans are slid over under protocols of `midastouch benchmark`. While the state is `converged`, the published region of
95 % is to hold the truth in 95 % of the frames under each of them, those at a wrong pose included: `WIDTH` of
`midastouch_filter/core/alignment.py`. `WHITE` is the one of some that takes the smallest regions for it.
How often the regions of one half of the scans hold the truth on the other half is printed, too. Neither the ten test
objects are seen nor the ten further ones for judging.
"""

from __future__ import annotations

import sys

import numpy as np
from scipy.stats import chi2

from midastouch_benchmark.statistics.coverage import nees
from midastouch_benchmark.trials.cache import Cache
from midastouch_benchmark.trials.disturbances import Scene
from midastouch_benchmark.trials.protocols import PAPER, PROTOCOLS
from midastouch_benchmark.trials.sequence_trials import start_filter
from midastouch_benchmark.trials.trial import TrialFrame, run_trial
from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core.alignment import WHITE, WIDTH
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.estimate import Estimate
from midastouch_filter.core.state import CONVERGED
from midastouch_filter.filter import ParticleFilter
from midastouch_filter.policies import Policies, default_policies

from .training_scans import cache_of, parser_of, scans_of

CONDITIONS = ("plain", "late", "tool_bias", "push")
WHITES = (0.1, 0.25, 0.5, 1.0)
LEVEL = 0.95  # of the regions
CONFIG = FilterConfig(threads=1)
BIAS, SURE, TRANSLATION, ROTATION = range(4)  # columns of `ScoredScan`


class ScoredScan:
    """A filter over one object, and what is known of its converged frames: rows of the bias, the squared Mahalanobis
    distance of the truth, and the region's RMS in m and rad, these as if the factor of width and bias were 1.
    """

    def __init__(self, cache: Cache, mesh: ObjectMesh):
        self._mesh = mesh
        self._filter = ParticleFilter(mesh, cache.codebook(mesh), CONFIG, make_policies=self._policies)

    def _policies(self, *parts) -> Policies:
        policies = default_policies(*parts)
        self._region = policies.refine.region
        return policies

    def frames(self, slide: list[TrialFrame], name: str, number: int) -> np.ndarray:
        """Rows (N, 4) of a slide under the protocol of that name, started by its number."""
        rows = []

        def observe(frame: TrialFrame, estimate: Estimate, _: ParticleFilter) -> None:
            if estimate.status.state == CONVERGED:
                bias, wider = self._region.bias, WIDTH * (WHITE + self._region.bias) ** 2
                sizes = [np.sqrt(np.trace(estimate.covariance[k : k + 3, k : k + 3]) / wider) for k in (0, 3)]
                rows.append([bias, wider * nees(estimate, frame.truth), *sizes])

        scene = PROTOCOLS[name].disturb(Scene(slide, np.random.default_rng(number)))
        self._filter.reset(number)
        start_filter(self._filter, self._mesh, scene.frames[0].truth, PAPER, PROTOCOLS[name].beta)
        run_trial(scene.frames, self._filter, observe, series=False)
        return np.array(rows).reshape(-1, 4)


def surprise(rows: np.ndarray, white: float) -> np.ndarray:
    """Squared Mahalanobis distances (N,) of the truth, of rows (N, 4), if the factor were of the bias alone."""
    return rows[:, SURE] / (white + rows[:, BIAS]) ** 2


def width(of: dict[str, np.ndarray], white: float) -> float:
    """With which the regions of each of the conditions, rows (N, 4), hold the truth at least as often as they say."""
    scores = [surprise(rows, white) for rows in of.values() if len(rows)]
    return max(float(np.quantile(each, LEVEL, method="higher")) for each in scores) / chi2.ppf(LEVEL, 6)


def sizes(of: dict[str, np.ndarray], white: float, factor: float) -> np.ndarray:
    """Median RMS (2,) of the regions, m and rad."""
    rows = np.concatenate(list(of.values()))
    wider = np.sqrt(factor) * (white + rows[:, BIAS])
    return np.median(wider[:, None] * rows[:, [TRANSLATION, ROTATION]], axis=0)


def held(of: dict[str, np.ndarray], white: float, factor: float) -> str:
    """How often the truth is in the region, by condition."""
    limit = factor * chi2.ppf(LEVEL, 6)
    inside = {name: surprise(rows, white) <= limit for name, rows in of.items() if len(rows)}
    return ", ".join(f"{name} {each.mean():.0%} of {len(each)}" for name, each in inside.items())


def main() -> None:
    args = parser_of(__doc__, "out/fit_regions", every=4, poses=20_000).parse_args()
    cache = cache_of(args)
    found: dict[str, list[np.ndarray]] = {name: [] for name in CONDITIONS}
    for mesh in scans_of(args):
        slides = [cache.frames(mesh, k) for k in range(args.slides)]
        scored = ScoredScan(cache, mesh)
        for name in CONDITIONS:
            found[name].append(np.concatenate([scored.frames(slide, name, k) for k, slide in enumerate(slides)]))
        print(mesh.name, {name: len(parts[-1]) for name, parts in found.items()}, file=sys.stderr, flush=True)

    every, *halves = (
        {name: np.concatenate(parts[part]) for name, parts in found.items()}
        for part in (slice(None), slice(0, None, 2), slice(1, None, 2))
    )
    for white in WHITES:
        factor = width(every, white)
        size = sizes(every, white, factor)
        said = f"median {1e3 * size[0]:.2f} mm, {np.degrees(size[1]):.1f} deg; {held(every, white, factor)}"
        print(f"WHITE {white}, WIDTH {factor:.3g}: {said}")
    for fitted, other in (halves, halves[::-1]):
        factor = width(fitted, WHITE)
        print(f"WHITE {WHITE}, WIDTH {factor:.3g} of one half of the scans: {held(other, WHITE, factor)} of the other")


if __name__ == "__main__":
    main()
