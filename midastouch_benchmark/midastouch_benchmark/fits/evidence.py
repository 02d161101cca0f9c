"""Fit what the filter assumes of the evidence of touches, from simulated ones on objects made by code.

.venv/bin/python -m midastouch_benchmark.fits.evidence [--objects 8] [--windows 3] [--seed 0]

Shapes and parts as the trainer's are slid over by random sensors; the networks see the images. Each window of touches
is explained from its true pose and from the competitors that codes bring up. The fit finds and prints the constants of
`midastouch_filter/core/noise_model.py` with which the odds between the two are as often right as they claim, and what
they leave unexplained. The mathematics: docs/internals.md. No test object is seen.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
from collections.abc import Iterator

import numpy as np
from scipy.optimize import minimize

from midastouch_benchmark.single_touch.simulated_touch import Lighting, TouchSimulator
from midastouch_benchmark.trials.setup import Networks
from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.keyframes import KeyframeWindow, WeighedWindow
from midastouch_filter.core.motion_model import Odometry
from midastouch_filter.core.noise_model import Effort, NoiseModel
from midastouch_filter.core.object_model import ObjectModel
from midastouch_filter.core.pose_hypothesis import APART, pose_distance
from midastouch_filter.core.touch import Measurement, reduced_penetration
from midastouch_filter.core.workers import Workers
from midastouch_filter.smoothing.competitor_search import CompetitorSearch
from midastouch_filter.smoothing.window_likelihood import Followed, Race, WindowLikelihood
from midastouch_perception.codebook_build import build_codebook
from midastouch_perception.simulation.slide import measure_poses, simulate_slide
from midastouch_perception.training.setting import MAKERS

SPACING = 0.01  # m between touches: less than their correlation
TOUCHES = 20  # of a window: one imaginary sensor's
ENTRIES = 8_000
COMPETITORS = 6
LENGTHS = (1, 3, 8, TOUCHES)  # parts of a window that must each be right about their odds
CONFIG = FilterConfig(threads=1)
NOISE = NoiseModel.of(CONFIG)


@dataclasses.dataclass(frozen=True)
class Pair:
    """Residual ratios (K,) of a window's maps at the true pose and at a competitor, oldest first; name of the object;
    symmetric: the competitor is the true pose too, found from another side: what tells the two apart is noise."""

    name: str
    true: np.ndarray
    competitor: np.ndarray
    symmetric: bool


def window_pairs(mesh: ObjectMesh, networks: Networks, count: int, rng: np.random.Generator) -> Iterator[Pair]:
    """Of `count` windows over one object."""
    # every competitor is followed to the end, however bad it is
    noise = dataclasses.replace(NOISE, refuted=-np.inf, code_margin=np.inf)
    for model, window, truth in windows(mesh, networks, noise, count, rng):
        search = CompetitorSearch(model.lookup, model.symmetry.exact, noise, Effort())
        entry = model.lookup.exact(truth[-1][None])[0]
        beside = model.lookup.poses[model.lookup.neighbours[entry, 2]]
        taken = [model.lookup.poses[entry]]
        competitors = [beside, *exhaust(search.find(window, taken)).poses]
        likelihood = WindowLikelihood(window, model.alignment, noise, Effort(), CONFIG.penetration_fit, Race(window))
        for start in taken + competitors[: COMPETITORS + 1]:
            exhaust(likelihood.follow(start))
        own, *others = [(each.residual_ratio, _distance(each, truth)) for each in likelihood.followed]
        if own[1] < 0.5 * APART:
            for residual, distance in others:
                if not 0.5 * APART <= distance <= APART:
                    yield Pair(mesh.name, own[0], residual, distance < APART)


def windows(
    mesh: ObjectMesh, networks: Networks, noise: NoiseModel, count: int, rng: np.random.Generator
) -> Iterator[tuple[ObjectModel, WeighedWindow, list[np.ndarray]]]:
    """The object, and `count` windows of touches over it with the true poses (4, 4) of their keyframes; short ones are
    left out."""
    book = build_codebook(mesh, networks.tcn, networks.sensor, ENTRIES)
    model = ObjectModel(mesh, book, CONFIG, noise, Workers(1))
    simulator = TouchSimulator(mesh, networks, Lighting("random"))
    for _ in range(count):
        try:
            slide = simulate_slide(mesh, networks.sensor.for_maps, 0.3, rng)
        except InputError:  # it got stuck
            continue
        window, truth = _touched(slide, model, simulator, networks, rng)
        if len(window.keyframes) >= TOUCHES // 2:
            yield model, window, truth


def _touched(slide, model, simulator, networks, rng) -> tuple[WeighedWindow, list[np.ndarray]]:
    """A window of touches along the slide, and the true poses of its keyframes."""
    measured = measure_poses(slide, rng)
    window, chosen, path = KeyframeWindow(TOUCHES, SPACING, NOISE.touch_correlation, Effort().shortlist), [0], 0.0
    for i in range(1, len(slide)):
        path += Odometry.from_matrix(se3.inverse(slide[i - 1]) @ slide[i]).path
        if path >= SPACING:
            chosen.append(i)
            path = 0.0
    chosen, true_pose, last = chosen[:TOUCHES], {}, None
    percepts = next(simulator.percepts(slide[chosen], rng))
    codes = networks.tcn.encode(percepts.penetration)
    for i, penetration, code, in_contact in zip(chosen, percepts.penetration, codes, percepts.in_contact, strict=True):
        step = np.eye(4) if last is None else se3.inverse(measured[last]) @ measured[i]
        window.moved(step, SPACING, in_contact=True)
        last = i
        if in_contact:
            unit = model.measurement.unit_code(code)
            model.measurement.score_codebook(unit)
            window.keep([Measurement(True, unit, penetration=reduced_penetration(penetration))],
                        [model.measurement.log_ratio.copy()])  # fmt: skip
            true_pose[id(window.keyframes[-1])] = slide[i]
    keyframes = list(window.keyframes)
    weights = np.full(len(keyframes), SPACING / NOISE.touch_correlation)
    return WeighedWindow(keyframes, weights, np.full(len(keyframes), 1e-9)), [
        true_pose[id(keyframe)] for keyframe in keyframes
    ]


def _distance(place: Followed, truth: list[np.ndarray]) -> float:
    """Median along the window [m] between a place and the truth; 1 rad counts as 10 mm."""
    return float(np.median([pose_distance(pose, true) for pose, true in zip(place.poses, truth, strict=True)]))


def exhaust(generator):
    """What a generator returns at its end."""
    while True:
        try:
            next(generator)
        except StopIteration as stop:
            return stop.value


def surprise(parameters: np.ndarray, pairs: list[Pair], lengths: tuple[int, ...] = LENGTHS) -> float:
    """Mean nats by which the odds between true poses and competitors surprise, each object counting the same.

    Of a symmetric pose either answer is right, so that sure odds surprise.

    parameters: logarithms of `map_patches` and `residual_floor`, and the logit of a touch's weight `SPACING` after the
    last one.
    """
    patches, floor, weight = np.exp(parameters[0]), np.exp(parameters[1]), 1 / (1 + np.exp(-parameters[2]))
    of_object: dict[str, list[float]] = {}
    for pair in pairs:
        odds = patches * np.log((pair.competitor + floor) / (pair.true + floor))
        for length in lengths:
            parts = odds[: len(odds) // length * length].reshape(-1, length)
            if len(parts):
                weights = np.r_[1.0, np.full(length - 1, weight)]
                lost = np.logaddexp(0, -parts @ weights)
                if pair.symmetric:
                    lost = 0.5 * (lost + np.logaddexp(0, parts @ weights)) - np.log(2)
                of_object.setdefault(pair.name, []).append(lost.mean())
    return float(np.mean([np.mean(each) for each in of_object.values()]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--objects", type=int, default=8)
    parser.add_argument("--windows", type=int, default=3, help="on each object")
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    networks, pairs = Networks.load(), []
    for i in range(args.objects):
        rng = np.random.default_rng([args.seed, i])
        pairs += window_pairs(MAKERS[i % len(MAKERS)](rng, f"fit_{i}"), networks, args.windows, rng)
        print(f"{i + 1} of {args.objects} objects, {len(pairs)} pairs of poses", file=sys.stderr, flush=True)
    found = minimize(surprise, [1.0, -6.5, -0.5], args=(pairs,), method="Nelder-Mead", options={"maxiter": 300}).x
    weight = 1 / (1 + np.exp(-found[2]))
    print(f"map_patches {np.exp(found[0]):.2f}, residual_floor {np.exp(found[1]):.2g}")
    print(f"correlation length {1e3 * SPACING / weight:.0f} mm")
    for length in LENGTHS:
        if any(len(pair.true) >= length for pair in pairs):
            print(f"{length:2d} touches: {surprise(found, pairs, (length,)):.3f} nats of 0.693 left")


if __name__ == "__main__":
    main()
