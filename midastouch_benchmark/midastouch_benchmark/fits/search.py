"""How much of what the true pose is worth the filter's search for hypotheses finds, on windows of simulated touches.

.venv/bin/python -m midastouch_benchmark.fits.search [--objects 18] [--windows 3] [--seed 5]

Shapes and parts as the trainer's are slid over by random sensors; the networks see the images. Each window of touches
is explained once from the true pose, and once as the filter does it that knows nothing: from the hypotheses that codes
bring up. Printed are the fractions of windows in which one of these is at the true pose, and in which it has its
evidence up to 3 nats, the nats that are lost, and how many alignments that takes: what `code_margin`, `kept` and
`_BASIN` are chosen by. No test object is seen.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
from collections.abc import Iterator

import numpy as np

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
from midastouch_filter.core.pose_hypothesis import ANOTHER
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
CONFIG = FilterConfig(threads=1)
NOISE = NoiseModel.of(CONFIG)
_AS_GOOD = 3.0  # nats


@dataclasses.dataclass(frozen=True)
class Found:
    """Of one window: followed, whether a hypothesis ended at the true pose; lost, nats of the truth's evidence that the
    best such one lacks, all of it if there is none; alignments that were made."""

    followed: bool
    lost: float
    alignments: int


def windows(
    mesh: ObjectMesh, networks: Networks, count: int, rng: np.random.Generator
) -> Iterator[tuple[ObjectModel, WeighedWindow, list[np.ndarray]]]:
    """The object, and `count` windows of touches over it with the true poses (4, 4) of their keyframes; short ones are
    left out."""
    book = build_codebook(mesh, networks.tcn, networks.sensor, ENTRIES)
    model = ObjectModel(mesh, book, CONFIG, NOISE, Workers(1))
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


def exhaust(generator):
    """What a generator returns at its end."""
    while True:
        try:
            next(generator)
        except StopIteration as stop:
            return stop.value


def search(window: WeighedWindow, truth: list[np.ndarray], model: ObjectModel) -> Found:
    """Explain a window from nothing known; truth: poses (4, 4) at its keyframes."""
    noise = dataclasses.replace(NOISE, refuted=-np.inf)
    goal = WindowLikelihood(window, model.alignment, noise, Effort(), CONFIG.penetration_fit, Race(window))
    exhaust(goal.follow(truth[-1]))
    race = Race(window)
    likelihood = WindowLikelihood(window, model.alignment, NOISE, Effort(), CONFIG.penetration_fit, race)
    for pose in exhaust(CompetitorSearch(model.lookup, model.symmetry.exact, NOISE, Effort()).find(window, [])).poses:
        if race.alignments < Effort().alignments:
            exhaust(likelihood.follow(pose))
    right = [each for each in likelihood.followed if each.at == 0 and _is_at(each, truth, model)]
    worth = _evidence(goal.followed[0], window)
    lost = worth - max((_evidence(each, window) for each in right), default=0.0)
    return Found(bool(right), lost, race.alignments)


def _evidence(followed: Followed, window: WeighedWindow) -> float:
    """Nats that its maps speak for a hypothesis, against one that explains none of them."""
    gained = NOISE.residual_evidence(followed.residual_ratio) - NOISE.residual_evidence(1.0)
    return float(window.weights @ gained)


def _is_at(followed: Followed, truth: list[np.ndarray], model: ObjectModel) -> bool:
    pairs = zip(followed.poses, truth, strict=True)
    return np.median([model.symmetry.exact.distance(pose[None], true)[0] for pose, true in pairs]) < ANOTHER


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--objects", type=int, default=18)
    parser.add_argument("--windows", type=int, default=3, help="on each object")
    parser.add_argument("--seed", type=int, default=5)
    args = parser.parse_args()
    networks, of_kind = Networks.load(), {}
    for i in range(args.objects):
        rng, make = np.random.default_rng([args.seed, i]), MAKERS[i % len(MAKERS)]
        mesh = make(rng, f"search_{i}")
        for model, window, truth in windows(mesh, networks, args.windows, rng):
            of_kind.setdefault(make.__name__, []).append(search(window, truth, model))
        print(f"{i + 1} of {args.objects} objects", file=sys.stderr, flush=True)
    for kind, found in of_kind.items():
        lost = np.array([each.lost for each in found])
        print(
            f"{kind}: {len(found)} windows, true pose followed in {np.mean([each.followed for each in found]):.2f}, "
            f"with its evidence in {np.mean(lost < _AS_GOOD):.2f}; {np.median(lost):.1f} nats lost in the median, "
            f"{lost.mean():.1f} in the mean; {np.mean([each.alignments for each in found]):.0f} alignments"
        )


if __name__ == "__main__":
    main()
