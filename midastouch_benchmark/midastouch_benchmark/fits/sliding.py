"""The loop that fits share: filters slide over training objects, and constants are chosen that explain what they find.

The scans include neither the paper's ten objects nor the ten that were held out for judging.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import TypeVar

import numpy as np
from scipy.optimize import minimize

from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_common.pose_metric import pose_distance
from midastouch_filter.core.alignment import PenetrationAlignment
from midastouch_filter.core.belief import Hypotheses
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.motion_model import Odometry
from midastouch_filter.core.noise_model import NoiseModel
from midastouch_filter.filter import ParticleFilter

from ..trials.cache import Cache, SlideKind
from ..trials.object_sets import meshes_to_fit_on
from ..trials.trial import TrialFrame, with_odometry

LENGTH = 0.3  # m of a slide
CONFIG = FilterConfig(threads=1, alignments_per_second=1_000_000)
"""Settings as shipped, except that each comparison is complete before the next frame."""
NOISE = NoiseModel.of(CONFIG)
FIRST = 100
"""Number of the first slide of a fit; `midastouch benchmark` and `midastouch identify` judge by those from 0 on."""


_T = TypeVar("_T")


def parser_of(
    description: str, out: str, every: int, poses: int, meshes_required: bool = True
) -> argparse.ArgumentParser:
    """Return a parser of the options of `cache_of` and `scans_of`, and of the number of slides over each scan."""
    parser = argparse.ArgumentParser(description=description.partition("\n")[0])
    parser.add_argument("--meshes", type=Path, required=meshes_required)
    parser.add_argument("--out", type=Path, default=Path(out))
    parser.add_argument("--slides", type=int, default=2, help="over each scan")
    parser.add_argument("--every", type=int, default=every, help="n-th training scan is taken")
    parser.add_argument("--poses", type=int, default=poses, help="of each codebook")
    return parser


def cache_of(args: argparse.Namespace, length: float = LENGTH) -> Cache:
    """Return a cache of slides of this length [m] and of codebooks, in the folder of the fit."""
    return Cache(args.out, slides=SlideKind(length), codebook_size=args.poses)


def scans_of(args: argparse.Namespace) -> Iterator[ObjectMesh]:
    """Return the training scans asked for; none without a folder of them."""
    return map(ObjectMesh.load, meshes_to_fit_on(args.meshes)[:: args.every] if args.meshes else ())


def over_slides(
    cache: Cache,
    meshes: Sequence[ObjectMesh],
    numbers: Iterable[int],
    measure: Callable[[ObjectMesh, list[TrialFrame], int], list[_T]],
) -> Iterator[list[_T]]:
    """Yield, for each object, all that `measure(object, frames of a slide, its number)` finds on slides over it.

    A slide that does not fit on an object is named and left out.
    """
    for count, mesh in enumerate(meshes, start=1):
        found: list[_T] = []
        for number in numbers:
            try:
                found += measure(mesh, cache.frames(mesh, number), number)
            except InputError as error:
                print(error, file=sys.stderr)
        print(f"{count} of {len(meshes)} objects; {mesh.name}: {len(found)}", file=sys.stderr, flush=True)
        yield found


def fitted(names: Sequence[str], surprise: Callable[[NoiseModel], float], **options: object) -> NoiseModel:
    """Return the constants with which something surprises least [nats]; those not in `names` stay as they are.

    options: of the search by Nelder and Mead, over the logarithms.
    """

    def assumed(parameters: np.ndarray) -> NoiseModel:
        return dataclasses.replace(NOISE, **dict(zip(names, np.exp(parameters).tolist(), strict=True)))

    start = np.log([getattr(NOISE, name) for name in names])
    found = minimize(
        lambda parameters: surprise(assumed(parameters)),
        start,
        method="Nelder-Mead",
        options={"maxiter": 150} | options,
    )
    return assumed(found.x)


@dataclasses.dataclass(frozen=True)
class Keyframe:
    """A compared touch. frame; weight: fraction of an independent touch that it counts, in [0, 1]; motion (4, 4), path
    [m], turns included: since the last keyframe."""

    frame: TrialFrame
    weight: float
    motion: np.ndarray
    path: float


def keyframes(particle_filter: ParticleFilter, frames: Iterable[TrialFrame]) -> Iterator[Keyframe]:
    """Slide a started filter along frames in contact; yield each keyframe after its comparison."""
    motion, path, count = np.eye(4), 0.0, 0
    for frame, odometry in with_odometry(frames):
        if odometry is not None:
            motion, path = motion @ odometry, path + Odometry.from_matrix(odometry).path
        skipped = particle_filter.step(odometry, frame.measurement, elapsed=frame.seconds).status.skipped
        particle_filter.deferred_update()
        if skipped.get("keyframes", 0) > count:
            yield Keyframe(frame, _weight(particle_filter.measured_gels), motion, path)
            motion, path, count = np.eye(4), 0.0, skipped["keyframes"]


def _weight(gels: np.ndarray) -> float:
    """Return the fraction of an independent touch that the last one of gels (F, 4, 4) counts in the filter."""
    nearest = pose_distance(gels[:-1], gels[-1]).min(initial=np.inf)
    return float(min(nearest / NOISE.touch_correlation, 1.0))


def follow(
    hypotheses: Hypotheses, keyframe: Keyframe, alignment: PenetrationAlignment
) -> tuple[Hypotheses, np.ndarray]:
    """Return hypotheses on one object at the next keyframe, and the fraction (P,) of its map that each explains."""
    moved = hypotheses.moved(keyframe.motion).widened(keyframe.path * NOISE.drift)
    found = alignment.align_each(moved.poses, moved.covariances, [keyframe.frame.measurement])
    there = dataclasses.replace(moved, poses=found.poses, covariances=found.covariances)
    return there, found.fits[:, 0]
