"""Size the published regions: a split-conformal quantile over slides across training scans.

.venv/bin/python -m midastouch_benchmark.fits.regions --meshes ../shared/meshes/ycb [--slides 2] [--every 4]

Scans are slid over under protocols of `midastouch benchmark`. `REGION_WIDTH` of `midastouch_filter/core/noise_model.py`
is fitted so that, while the state is `converged`, the published region of 95 % holds the truth in 95 % of the frames
under each protocol, those at a wrong pose included. The program also prints how often the regions fitted on one half of
the scans hold the truth on the other half. It uses neither the ten test objects nor the ten further ones for judging.
"""

from __future__ import annotations

import numpy as np
from scipy.stats import chi2

from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.estimate import Estimate
from midastouch_filter.core.noise_model import REGION_WIDTH
from midastouch_filter.core.state import CONVERGED
from midastouch_filter.filter import ParticleFilter

from ..statistics.coverage import nees
from ..trials.disturbances import UndisturbedSlide
from ..trials.protocols import PAPER, PROTOCOLS
from ..trials.sequence_trials import start_filter
from ..trials.trial import TrialFrame, run_trial
from .sliding import cache_of, over_slides, parser_of, scans_of

CONDITIONS = ("plain", "late", "tool_bias", "push")
LEVEL = 0.95  # of the regions
SURPRISE, TRANSLATION, ROTATION = range(3)  # columns of `converged_frames`


def converged_frames(
    particle_filter: ParticleFilter, mesh: ObjectMesh, slide: list[TrialFrame], name: str, number: int
) -> np.ndarray:
    """Return rows (N, 3) of the converged frames of a slide under the protocol `name`: squared Mahalanobis distance of
    the truth, and the region's RMS in m and rad, as if `REGION_WIDTH` were 1."""
    rows = []

    def observe(frame: TrialFrame, estimate: Estimate, _: object) -> None:
        if estimate.status.state == CONVERGED:
            truth = particle_filter.object.symmetry.exact.nearest(frame.truth[None], estimate.pose)[0]
            sizes = [np.sqrt(np.trace(estimate.covariance[k : k + 3, k : k + 3]) / REGION_WIDTH) for k in (0, 3)]
            rows.append([REGION_WIDTH * nees(estimate, truth), *sizes])

    scene = PROTOCOLS[name].disturb(UndisturbedSlide(slide, np.random.default_rng(number)))
    particle_filter.reset(number)
    start_filter(particle_filter, mesh, scene.frames[0].truth, PAPER, PROTOCOLS[name].beta)
    run_trial(scene.frames, particle_filter, observe, series=False)
    return np.array(rows).reshape(-1, 3)


def width(of: dict[str, np.ndarray]) -> float:
    """Return the factor with which the regions of each of the conditions, rows (N, 3), hold the truth at least as often
    as they claim."""
    quantiles = [np.quantile(rows[:, SURPRISE], LEVEL, method="higher") for rows in of.values() if len(rows)]
    return float(max(quantiles)) / chi2.ppf(LEVEL, 6)


def held(of: dict[str, np.ndarray], factor: float) -> str:
    """Return text on the size of the regions and on how often the truth is in them, by condition."""
    inside = {name: rows[:, SURPRISE] <= factor * chi2.ppf(LEVEL, 6) for name, rows in of.items() if len(rows)}
    size = np.sqrt(factor) * np.median(np.concatenate(list(of.values())), axis=0)
    often = ", ".join(f"{name} {each.mean():.0%} of {len(each)}" for name, each in inside.items())
    return f"median {1e3 * size[TRANSLATION]:.2f} mm, {np.degrees(size[ROTATION]):.1f} deg; {often}"


def main() -> None:
    """Print the factor for all scans, and how those of two halves do on the other half."""
    args = parser_of(__doc__, "out/fit_regions", every=4, poses=20_000).parse_args()
    cache = cache_of(args)

    def measure(mesh: ObjectMesh, slide: list[TrialFrame], number: int) -> list[dict[str, np.ndarray]]:
        running = ParticleFilter(mesh, cache.codebook(mesh), FilterConfig(threads=1))
        return [{name: converged_frames(running, mesh, slide, name, number) for name in CONDITIONS}]

    found = list(over_slides(cache, list(scans_of(args)), range(args.slides), measure))
    every, *halves = (
        {name: np.concatenate([slide[name] for some in found[part] for slide in some]) for name in CONDITIONS}
        for part in (slice(None), slice(0, None, 2), slice(1, None, 2))
    )
    print(f"REGION_WIDTH {width(every):.3g}: {held(every, width(every))}")
    for one, other in (halves, halves[::-1]):
        print(f"REGION_WIDTH {width(one):.3g} of one half of the scans: {held(other, width(one))} of the other")


if __name__ == "__main__":
    main()
