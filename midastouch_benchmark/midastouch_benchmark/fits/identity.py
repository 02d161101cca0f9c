"""Fit what the filter assumes of touches on objects that are in a catalogue, and on those that are not.

.venv/bin/python -m midastouch_benchmark.fits.identity --meshes ../shared/meshes/ycb [--slides 2] [--every 1]

Training scans are shared out at random to catalogues of each size. Each object is slid over, once with its catalogue,
once with the catalogue without it. A catalogue of one is the filter that knows one object: it gets touches of that, and
of the next one; so do random parts with sharp edges. What makes the probabilities of the object, or of `unknown`, say
the truth as often as they claim, after every comparison on the way, is printed: constants of
`midastouch_filter/core/noise_model.py`. The mathematics: docs/internals.md. No test object is seen, nor any of the ten
further ones for judging.

`--catalogues 1` takes ten minutes and fits what holds for a single object; the others take an hour.
"""

from __future__ import annotations

import dataclasses
import itertools
import sys
from collections.abc import Sequence

import numpy as np
from scipy.optimize import minimize

from midastouch_benchmark.trials import disturbances
from midastouch_benchmark.trials.cache import Cache
from midastouch_benchmark.trials.disturbances import Disturbance
from midastouch_benchmark.trials.trial import with_odometry
from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.noise_model import NoiseModel
from midastouch_filter.identification.catalogue import Catalogue
from midastouch_filter.identification.identification import Identification
from midastouch_filter.smoothing.contest import Contest
from midastouch_perception.simulation.random_parts import random_part

from .comparisons import comparisons
from .training_scans import cache_of, parser_of, scans_of

CONFIG = FilterConfig(threads=1)
NOISE = NoiseModel.of(CONFIG)
FIRST = 100  # number of the first slide: `midastouch identify` judges by those from 0 on
HALF = 0.5  # of the slides are over an object that is not in the catalogue
FITTED = ("between_objects", "foreign_residual", "innovation_cost")
DISTURBED = (
    disturbances.plain,
    disturbances.tool_bias,
    disturbances.late,
    disturbances.push,
    disturbances.slow_camera,
)
"""What happens on slides over a single object, by turns, where that is asked for: an arm or an object that moves
otherwise than it is said to must not be taken for another object."""
ALONE = ("alone_residual", "alone_innovation_cost")  # of a catalogue of one
REFUSED = 0.95  # probability of another object from which on the state says so
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

    def unknown(self, noise: NoiseModel) -> float:
        """Probability at the end that it is none of the objects."""
        return self.probabilities(self.contests[-1], noise)[1]

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
    contests = []
    for frame, odometry in with_odometry(cache.frames(mesh, number)):
        if identification.step(odometry, frame.measurement):
            contests.append(identification.contest)
    names = [entry.name for entry in catalogue.entries]
    return Slide(contests, names.index(mesh.name) if mesh.name in names else None, len(names))


def slid_alone(cache: Cache, mesh: ObjectMesh, touched: ObjectMesh, number: int, disturb: Disturbance) -> Slide:
    """What a filter that knows one object, and nothing else, makes of a slide over that, or over another one."""
    contests = [each.contest for _, each in comparisons(cache, mesh, touched, number, CONFIG, disturb)]
    return Slide(contests, 0 if touched is mesh else None, 1)


def fit(names: Sequence[str], slides: list[Slide]) -> None:
    """Print the constants of these names that fit the slides best, and how often the answers are right with them."""
    if not slides:
        return

    def assumed(parameters: np.ndarray) -> NoiseModel:
        return dataclasses.replace(NOISE, **dict(zip(names, np.exp(parameters), strict=True)))

    found = minimize(
        lambda parameters: np.mean([slide.surprise(assumed(parameters)) for slide in slides]),
        np.log([getattr(NOISE, name) for name in names]),
        method="Nelder-Mead",
        options={"maxiter": 150, "xatol": 0.02, "fatol": 1e-3},
    )
    print(*(f"{name} {value:.3g}" for name, value in zip(names, np.exp(found.x), strict=True)), sep=", ")
    for what, some in (("in", [s for s in slides if s.truth is not None]),
                       ("left out of", [s for s in slides if s.truth is None])):  # fmt: skip
        right = np.mean([slide.is_right(assumed(found.x)) for slide in some])
        refused = np.mean([slide.unknown(assumed(found.x)) > REFUSED for slide in some])
        print(
            f"object {what} the catalogue: {right:.0%} of {len(some)} slides right at the end, {refused:.1%} say none"
        )
    print(f"{found.fun:.3f} nats of surprise")


def main() -> None:
    parser = parser_of(__doc__, "out/fit_identity", every=1, poses=10_000)
    parser.add_argument("--catalogues", type=int, nargs="+", default=[1, 10, 58], help="objects in each")
    parser.add_argument("--parts", type=int, default=30, help="random parts, each for a catalogue of one")
    parser.add_argument("--disturbed", action="store_true", help="arm and object move otherwise than they are said to")
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    meshes, cache, slides = list(scans_of(args)), cache_of(args), []
    numbers, rng = range(FIRST, FIRST + args.slides), np.random.default_rng(args.seed)
    order = rng.permutation(len(meshes))
    if 1 in args.catalogues:
        parts = [random_part(rng, f"part_{args.seed}_{k}") for k in range(args.parts)]
        alone = [meshes[i] for i in order] + parts
        for k, mesh in enumerate(alone):
            for touched, number in itertools.product((mesh, alone[k - 1]), numbers):
                disturb = DISTURBED[(k + number) % len(DISTURBED)] if args.disturbed else disturbances.plain
                slides.append(slid_alone(cache, mesh, touched, number, disturb))
        print(f"{len(slides)} slides", file=sys.stderr, flush=True)
    groups = [np.array_split(order, max(round(len(meshes) / size), 1)) for size in args.catalogues if size > 1]
    for group in itertools.chain(*groups):
        # by their files, so that as many poses are compared as by the filter
        books = [(meshes[i], cache.codebook(meshes[i]), cache.codebook_path(meshes[i])) for i in group]
        whole = Catalogue.of(books, NOISE)
        for i in group:
            for catalogue in (whole, whole.without(meshes[i].name)):
                slides += [slid(cache, catalogue, meshes[i], number) for number in numbers]
        print(f"{len(slides)} slides", file=sys.stderr, flush=True)
    slides = [slide for slide in slides if slide.contests]
    fit(ALONE, [slide for slide in slides if slide.objects == 1])
    fit(FITTED, [slide for slide in slides if slide.objects > 1])


if __name__ == "__main__":
    main()
