"""Fit the filter's model of the evidence of touches, so that its probabilities are right as often as they claim.

.venv/bin/python -m midastouch_benchmark.fits.evidence [--meshes ../shared/meshes/ycb] [--slides 2] [--every 4]

Slides over random parts with sharp edges, random shapes and, if there is a folder of them, training scans are cut into
pieces. On each piece a filter starts with nothing known; the modes that its first touch leaves are followed over the
other touches, and the truth shows which of them are right. The program prints the constants of
`midastouch_filter/core/noise_model.py` with which these are the most probable: both, and `map_patches` alone; the
result of a fit to one half of the objects on the other half; and how often the surest hypothesis is right. The
mathematics: docs/internals.md. It uses no test object.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Iterator, Sequence

import numpy as np

from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core.noise_model import NoiseModel
from midastouch_filter.core.pose_difference import another
from midastouch_filter.filter import ParticleFilter
from midastouch_simulation.procedural import random_shape
from midastouch_simulation.random_parts import random_part

from ..trials.cache import Cache
from ..trials.trial import TrialFrame
from ..trials.yardstick import Yardstick
from . import sliding
from .sliding import CONFIG, FIRST, NOISE, cache_of, follow, keyframes, over_slides, parser_of, scans_of

LENGTH = 0.5  # m of a slide
PIECE = 80  # frames, 0.12 m: some ten keyframes
DIAGONAL = 0.045, 0.2  # m, of objects made by code
FREE = ("map_patches", "residual_floor")
ALONE = ("map_patches",)
BINS = (0.0, 0.5, 0.8, 0.95, 0.99, 1.0)  # of the probability of the surest hypothesis
_MOST = 20.0  # nats, largest surprise: by a truth that was all but excluded


@dataclasses.dataclass(frozen=True)
class Judged:
    """Comparison of P hypotheses by K maps. residual_ratio: (P, K), fraction of each map that is left unexplained;
    weights: (K,), fraction of an independent touch that each map counts; right: (P,), which hypotheses are."""

    residual_ratio: np.ndarray
    weights: np.ndarray
    right: np.ndarray

    def probabilities(self, noise: NoiseModel) -> np.ndarray:
        """Return probabilities (P,) by the maps alone."""
        nats = noise.residual_evidence(self.residual_ratio) @ self.weights
        return np.exp(nats - np.logaddexp.reduce(nats))

    def surprise(self, noise: NoiseModel) -> float:
        """Return the nats by which the truth surprises."""
        return min(-np.log(max(self.probabilities(noise)[self.right].sum(), np.exp(-_MOST))), _MOST)


def judged(cache: Cache, mesh: ObjectMesh, frames: list[TrialFrame]) -> Iterator[Judged]:
    """Yield the comparisons of two or more hypotheses on the pieces of a slide over an object."""
    particle_filter = ParticleFilter(mesh, cache.codebook(mesh), CONFIG)
    alignment, symmetry = particle_filter.object.alignment, particle_filter.object.symmetry.exact
    for start in range(0, len(frames) - PIECE, PIECE):
        particle_filter.reset(0)
        particle_filter.initialise_uniform()
        found = keyframes(particle_filter, frames[start : start + PIECE])
        first = next(found)
        leading = np.array([group.members[0] for group in particle_filter.groups], int)
        hypotheses = particle_filter.belief.hypotheses.some(leading)
        ratios, weights, last = [1.0 - hypotheses.fit], [first.weight], first
        for last in found:
            hypotheses, fit = follow(hypotheses, last, alignment)
            ratios.append(1.0 - fit)
            weights.append(last.weight)
        residual_ratio, differ = np.stack(ratios, axis=1), another(symmetry)
        kept: list[int] = []
        for i in np.argsort(residual_ratio.mean(axis=1), kind="stable"):  # hypotheses that have met are one
            if not kept or differ(hypotheses.poses[kept], hypotheses.poses[i]).all():
                kept.append(i)
        if len(kept) > 1:
            right = Yardstick.of(mesh, symmetry).right(hypotheses.poses[kept], last.frame.truth)
            yield Judged(residual_ratio[kept], np.array(weights), right)


def surprise(objects: Sequence[Sequence[Judged]], noise: NoiseModel) -> float:
    """Return the mean nats over the comparisons of each object, each object counting the same."""
    return float(np.mean([np.mean([each.surprise(noise) for each in some]) for some in objects]))


def fitted(names: Sequence[str], objects: Sequence[Sequence[Judged]]) -> NoiseModel:
    """Return the constants with which the truth surprises least; those not in `names` stay as they are."""
    start = np.log([getattr(NOISE, name) for name in names])
    simplex = start - np.vstack([np.zeros(len(names)), np.eye(len(names))])
    options = {"xatol": 0.01, "fatol": 1e-4, "initial_simplex": simplex}
    return sliding.fitted(names, lambda noise: surprise(objects, noise), **options)


def described(noise: NoiseModel) -> str:
    """Return the fitted constants as text."""
    return f"map_patches {noise.map_patches:.2f}, residual_floor {noise.residual_floor:.3f}"


def reliability(objects: Sequence[Sequence[Judged]], noise: NoiseModel) -> Iterator[str]:
    """Yield lines on how often the surest hypotheses are right, by their probability."""
    surest = []
    for each in itertools.chain(*objects):
        probabilities = each.probabilities(noise)
        surest.append((probabilities.max(), each.right[probabilities.argmax()]))
    said, right = np.array(surest).T
    bins = np.digitize(said, BINS[1:-1])
    for k, (low, high) in enumerate(itertools.pairwise(BINS)):
        if (bins == k).any():
            claims, holds = said[bins == k].mean(), right[bins == k].mean()
            yield f"  {low:.2f} to {high:.2f}: probability {claims:.3f}, right {holds:.3f} of {(bins == k).sum()}"


def made_by_code(parts: int, shapes: int, seed: int) -> Iterator[ObjectMesh]:
    """Yield random parts and shapes, in these numbers, neither too small for a slide nor too large for a hand."""
    for kind, make, count in (("part", random_part, parts), ("shape", random_shape, shapes)):
        rng = np.random.default_rng(seed)
        drawn = (make(rng, f"{kind}_{seed}_{k}") for k in itertools.count())
        yield from itertools.islice((mesh for mesh in drawn if DIAGONAL[0] <= mesh.diagonal <= DIAGONAL[1]), count)


def main() -> None:
    """Print the constants, and the reliability of the probabilities with them."""
    parser = parser_of(__doc__, "out/fit_evidence", every=4, poses=10_000, meshes_required=False)
    parser.add_argument("--parts", type=int, default=28, help="random parts")
    parser.add_argument("--shapes", type=int, default=8, help="random shapes")
    parser.add_argument("--seed", type=int, default=0, help="of parts and shapes")
    args = parser.parse_args()
    meshes = [*made_by_code(args.parts, args.shapes, args.seed), *scans_of(args)]
    cache, numbers = cache_of(args, LENGTH), range(FIRST, FIRST + args.slides)
    every = list(over_slides(cache, meshes, numbers, lambda mesh, frames, _: list(judged(cache, mesh, frames))))
    objects = [telling for some in every if (telling := [each for each in some if each.right.any()])]
    count, kept = (sum(map(len, some)) for some in (every, objects))
    print(
        f"{count} comparisons of two or more hypotheses on {len(meshes)} objects; none is right in "
        f"{1 - kept / max(count, 1):.1%} of them, which are left out"
    )
    alone = fitted(ALONE, objects)
    for what, noise in (("both fitted", fitted(FREE, objects)), ("map_patches fitted", alone), ("today", NOISE)):
        print(f"{what}: {described(noise)}; {surprise(objects, noise):.3f} nats of surprise")
        print(*reliability(objects, noise), sep="\n")
    halves = objects[::2], objects[1::2]
    for names, (some, others) in itertools.product((FREE, ALONE), (halves, halves[::-1])):
        noise = fitted(names, some)
        print(
            f"{', '.join(names)} fitted on one half of the objects: {described(noise)}; "
            f"{surprise(others, noise):.3f} nats on the other half, {surprise(others, NOISE):.3f} with today's"
        )


if __name__ == "__main__":
    main()
