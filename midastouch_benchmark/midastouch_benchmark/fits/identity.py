"""Fit the filter's model of touches on objects that it knows, and on objects that it does not know.

.venv/bin/python -m midastouch_benchmark.fits.identity --meshes ../shared/meshes/ycb [--slides 2] [--every 1]

Training scans are divided at random into sets of each size. Each object is slid over twice: by a filter that knows its
set, and by one that knows the set without it. In sets of one, a filter gets touches of its object and of another one;
random parts with sharp edges are added there. The program prints the constants of
`midastouch_filter/core/noise_model.py` with which the probabilities of the object, or of none, are right as often as
they claim, after every keyframe on the way. The mathematics: docs/internals.md. It uses neither test objects nor the
ten further ones for judging.

`--sets 1` takes ten minutes and fits what holds for a single object; the others take an hour.
"""

from __future__ import annotations

import dataclasses
import itertools
import sys
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core.belief import Hypotheses
from midastouch_filter.core.measurement_model import log_ratios
from midastouch_filter.core.noise_model import LEAST_UNKNOWN, MOST_UNKNOWN, NoiseModel
from midastouch_filter.core.object_model import ObjectModel
from midastouch_filter.core.workers import Workers
from midastouch_filter.filter import ParticleFilter
from midastouch_simulation.random_parts import random_part

from ..trials import disturbances
from ..trials.disturbances import Disturbance, UndisturbedSlide
from ..trials.trial import TrialFrame
from .sliding import CONFIG, FIRST, NOISE, cache_of, fitted, follow, keyframes, parser_of, scans_of

HALF = 0.5  # of the slides are over an object that the filter does not know
FITTED = ("code_support", "contradiction")
DISTURBED = (disturbances.plain, disturbances.tool_bias, disturbances.late, disturbances.push, disturbances.slow_camera)
"""Disturbances of slides over a single object, in turn, with `--disturbed`: an arm or an object that moves otherwise
than reported must not be taken for another object."""
REFUSED = 0.95  # probability of another object at which the state reports it
_IMPOSSIBLE = 1e-6  # least probability of the truth, which limits its surprise


@dataclasses.dataclass(frozen=True)
class WeighedSlide:
    """Slide of K keyframes over one of O objects. weights: (K,); code: (K, O), nats by which the code supports the
    leading hypothesis on each object; contradicted: (K, O), whether the hypothesis that led before leaves the map
    unexplained; both 0 without one; truth: number of the touched object, O if it is unknown."""

    weights: np.ndarray
    code: np.ndarray
    contradicted: np.ndarray
    truth: int

    def probabilities(self, noise: NoiseModel) -> np.ndarray:
        """Return probabilities (K, O + 1) of each object, and of none of them, after each keyframe."""
        gains = noise.object_evidence(self.code, self.contradicted)
        least, most = (np.log((1.0 - unknown) / unknown) for unknown in (MOST_UNKNOWN, LEAST_UNKNOWN))
        support, out = np.zeros(gains.shape[1]), []
        for gain in self.weights[:, None] * gains:
            support = np.clip(support + gain, least, most)
            odds = np.append((1.0 - HALF) / len(support) * np.exp(support), HALF)
            out.append(odds / odds.sum())
        return np.array(out)

    def surprise(self, noise: NoiseModel) -> float:
        """Return the mean nats by which the truth surprises along the slide."""
        return float(-np.log(np.maximum(self.probabilities(noise)[:, self.truth], _IMPOSSIBLE)).mean())


def slid(
    known: Sequence[ObjectModel], touched: ObjectMesh, frames: list[TrialFrame], disturb: Disturbance, seed: int
) -> WeighedSlide | None:
    """Run a slide over an object with a filter that knows some objects; None with fewer than two keyframes."""
    running = ParticleFilter.on(known, CONFIG)
    running.initialise_uniform()
    weights, codes, unexplained = [], [], []
    leading: dict[int, Hypotheses] = {}
    for keyframe in keyframes(running, disturb(UndisturbedSlide(frames, np.random.default_rng(seed))).frames):
        before = {k: follow(one, keyframe, known[k].alignment)[1][0] for k, one in leading.items()}
        hypotheses = running.belief.hypotheses
        order = np.argsort(-hypotheses.log_weights, kind="stable")
        numbers, first = np.unique(hypotheses.objects[order], return_index=True)
        leading = {int(k): hypotheses.some(order[[i]]) for k, i in zip(numbers, first, strict=True)}
        measured = [model.measurement for model in known]
        ratios = log_ratios(measured, measured[0].unit_code(keyframe.frame.measurement.code))
        at = {k: known[k].lookup.exact(one.poses)[0] for k, one in leading.items()}
        weights.append(keyframe.weight)
        codes.append([float(ratios[k][at[k]]) if k in at else 0.0 for k in range(len(known))])
        unexplained.append([float(before.get(k, 1.0) <= NOISE.explained) for k in range(len(known))])
    names = [model.mesh.name for model in known]
    truth = names.index(touched.name) if touched.name in names else len(names)
    return WeighedSlide(np.array(weights), np.array(codes), np.array(unexplained), truth) if len(weights) > 1 else None


def trials_of(size: int, scans: list[str], parts: list[str]) -> list[tuple[list[str], str]]:
    """Return names of the objects that a filter knows, in sets of this size, and of the one it touches, which it knows
    half of the time."""
    if size == 1:
        alone = [*scans, *parts]
        return [([name], touched) for k, name in enumerate(alone) for touched in (name, alone[k - 1])]
    sets = [group.tolist() for group in np.array_split(scans, max(round(len(scans) / size), 1))]
    return [
        (known, name) for some in sets for name in some for known in (some, [each for each in some if each != name])
    ]


def fit(slides: list[WeighedSlide]) -> None:
    """Print the constants that fit the slides best, and how often the answers are right with them."""

    def surprise(noise: NoiseModel) -> float:
        return float(np.mean([slide.surprise(noise) for slide in slides]))

    noise = fitted(FITTED, surprise, xatol=0.02, fatol=1e-3)
    print(*(f"{name} {getattr(noise, name):.3g}" for name in FITTED), sep=", ")
    for what, known in (("known", True), ("unknown", False)):
        ends = [(s.probabilities(noise)[-1], s.truth) for s in slides]
        ends = [(end, truth) for end, truth in ends if (truth < len(end) - 1) == known]
        right = np.mean([end.argmax() == truth for end, truth in ends])
        refused = np.mean([end[-1] > REFUSED for end, _ in ends])
        print(f"object {what}: {right:.0%} of {len(ends)} slides right at the end, {refused:.1%} say none")
    print(f"{surprise(noise):.3f} nats of surprise")


def main() -> None:
    """Print the constants for sets of each size."""
    parser = parser_of(__doc__, "out/fit_identity", every=1, poses=10_000)
    parser.add_argument("--sets", type=int, nargs="+", default=[1, 10, 58], help="objects in each")
    parser.add_argument("--parts", type=int, default=30, help="random parts, each in a set of one")
    parser.add_argument("--disturbed", action="store_true", help="arm and object move otherwise than reported")
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    meshes, cache, rng = list(scans_of(args)), cache_of(args), np.random.default_rng(args.seed)
    meshes = [meshes[i] for i in rng.permutation(len(meshes))]
    parts = [random_part(rng, f"part_{args.seed}_{k}") for k in range(args.parts)]
    of_name = {mesh.name: mesh for mesh in (*meshes, *parts)}

    @lru_cache(maxsize=max(args.sets))
    def model(name: str) -> ObjectModel:
        mesh = of_name[name]
        return ObjectModel(mesh, cache.codebook(mesh), CONFIG, NOISE, Workers(CONFIG.threads))

    for size in args.sets:
        slides, trials = [], trials_of(size, [mesh.name for mesh in meshes], [mesh.name for mesh in parts])
        for k, ((known, name), number) in enumerate(itertools.product(trials, range(FIRST, FIRST + args.slides))):
            disturb = DISTURBED[k % len(DISTURBED)] if args.disturbed and size == 1 else disturbances.plain
            frames = cache.frames(of_name[name], number)
            slides.append(slid([model(each) for each in known], of_name[name], frames, disturb, number))
            print(f"{len(slides)} of {len(trials) * args.slides} slides", file=sys.stderr, flush=True)
        print(f"sets of {size}:")
        fit([slide for slide in slides if slide])


if __name__ == "__main__":
    main()
