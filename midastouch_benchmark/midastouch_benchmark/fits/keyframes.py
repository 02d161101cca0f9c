"""Touches that a filter compares along a slide, and hypotheses that are followed from one to the next."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from midastouch_benchmark.trials.trial import TrialFrame, with_odometry
from midastouch_common.pose_metric import pose_distance
from midastouch_filter.core.alignment import PenetrationAlignment
from midastouch_filter.core.belief import Hypotheses
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.motion_model import Odometry
from midastouch_filter.core.noise_model import NoiseModel
from midastouch_filter.filter import ParticleFilter

CONFIG = FilterConfig(threads=1, alignments_per_second=1_000_000)
"""Settings as shipped, except that each comparison is complete before the next frame."""
NOISE = NoiseModel.of(CONFIG)
FIRST = 100
"""Number of the first slide of a fit; `midastouch benchmark` and `midastouch identify` judge by those from 0 on."""


@dataclass(frozen=True)
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
    there = replace(moved, poses=found.poses, covariances=found.covariances)
    return there, found.fits[:, 0]
