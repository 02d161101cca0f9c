"""Fit what the filter assumes of touches on objects that are in a catalogue, and on those that are not.

.venv/bin/python -m midastouch_benchmark.fits.identity --meshes ../shared/meshes/ycb [--slides 2] [--every 1]

Training scans are shared out at random to catalogues of each size. Each object is slid over, once with its catalogue,
once with the catalogue without it. What makes the probabilities of the object, or of `unknown`, say the truth as often
as they claim, after every comparison on the way, is printed: constants of `midastouch_filter/core/noise_model.py`. The
mathematics: docs/internals.md. No test object is seen, nor any of the ten further ones for judging.
"""

from __future__ import annotations

import dataclasses
import itertools
import sys

import numpy as np
from scipy.optimize import minimize

from midastouch_benchmark.trials.cache import Cache
from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.noise_model import NoiseModel
from midastouch_filter.identification.catalogue import Catalogue
from midastouch_filter.identification.identification import Identification
from midastouch_filter.identification.identity import Contest

from .training_scans import cache_of, parser_of, scans_of

CONFIG = FilterConfig(threads=1)
NOISE = NoiseModel.of(CONFIG)
FIRST = 100  # number of the first slide: `midastouch identify` judges by those from 0 on
HALF = 0.5  # of the slides are over an object that is not in the catalogue
FITTED = ("between_objects", "foreign_residual", "innovation_cost")
_IMPOSSIBLE = 1e-6  # probability below which the truth surprises no more


@dataclasses.dataclass(frozen=True)
class Slide:
    """contests: comparisons on the way over one object; truth, its number in the catalogue, None if it is not in there;
    objects, number of objects in the catalogue."""

    contests: list[Contest]
    truth: int | None
    objects: int

    def probabilities(self, contest: Contest, noise: NoiseModel) -> tuple[np.ndarray, float]:
        """Probabilities (objects,), and that of none of them."""
        probabilities, unknown = contest.posterior(noise, self.objects, HALF)
        return np.bincount(contest.owner, probabilities, self.objects), unknown

    def surprise(self, noise: NoiseModel) -> float:
        """Mean nats by which the truth surprises along the slide."""
        of_truth = []
        for contest in self.contests:
            probabilities, unknown = self.probabilities(contest, noise)
            of_truth.append(unknown if self.truth is None else probabilities[self.truth])
        return float(-np.log(np.maximum(of_truth, _IMPOSSIBLE)).mean())

    def is_right(self, noise: NoiseModel) -> bool:
        """Whether the most probable answer at the end is."""
        probabilities, unknown = self.probabilities(self.contests[-1], noise)
        return (
            unknown > probabilities.max()
            if self.truth is None
            else probabilities[self.truth] >= max(probabilities.max(), unknown)
        )


def slid(cache: Cache, catalogue: Catalogue, mesh: ObjectMesh, number: int) -> Slide:
    """What a catalogue makes of a slide over an object."""
    identification = Identification(catalogue, CONFIG, NOISE)
    contests, last = [], None
    for frame in cache.frames(mesh, number):
        moved = None if last is None else se3.inverse(last) @ frame.measured
        last = frame.measured
        if identification.step(moved, frame.measurement):
            contests.append(identification.contest)
    names = [entry.name for entry in catalogue.entries]
    return Slide(contests, names.index(mesh.name) if mesh.name in names else None, len(names))


def assumed(parameters: np.ndarray) -> NoiseModel:
    """The noise model of the logarithms of what is fitted."""
    return dataclasses.replace(NOISE, **dict(zip(FITTED, np.exp(parameters), strict=True)))


def main() -> None:
    parser = parser_of(__doc__, "out/fit_identity", every=1, poses=10_000)
    parser.add_argument("--catalogues", type=int, nargs="+", default=[10, 58], help="objects in each")
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    meshes, cache, slides = list(scans_of(args)), cache_of(args), []
    numbers = range(FIRST, FIRST + args.slides)
    order = np.random.default_rng(args.seed).permutation(len(meshes))
    parts = [np.array_split(order, max(round(len(meshes) / size), 1)) for size in args.catalogues]
    for group in itertools.chain(*parts):
        # by their files, so that as many poses are compared as by the filter
        books = [(meshes[i], cache.codebook(meshes[i]), cache.codebook_path(meshes[i])) for i in group]
        whole = Catalogue.of(books, NOISE)
        for i in group:
            for catalogue in (whole, whole.without(meshes[i].name)):
                slides += [slid(cache, catalogue, meshes[i], number) for number in numbers]
        print(f"{len(slides)} slides", file=sys.stderr, flush=True)
    slides = [slide for slide in slides if slide.contests]
    start = [getattr(NOISE, name) for name in FITTED]
    found = minimize(
        lambda parameters: np.mean([slide.surprise(assumed(parameters)) for slide in slides]),
        np.log(start),
        method="Nelder-Mead",
        options={"maxiter": 150, "xatol": 0.02, "fatol": 1e-3},
    )
    print(*(f"{name} {value:.3g}" for name, value in zip(FITTED, np.exp(found.x), strict=True)), sep=", ")
    for what, some in (("in", [s for s in slides if s.truth is not None]),
                       ("left out of", [s for s in slides if s.truth is None])):  # fmt: skip
        right = np.mean([slide.is_right(assumed(found.x)) for slide in some])
        print(f"object {what} the catalogue: {right:.0%} of {len(some)} slides right at the end")
    print(f"{found.fun:.3f} nats of surprise")


if __name__ == "__main__":
    main()
