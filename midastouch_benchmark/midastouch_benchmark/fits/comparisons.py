"""The comparisons that the filter makes on its way over an object, nothing being known at the start."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from midastouch_benchmark.trials import disturbances
from midastouch_benchmark.trials.cache import Cache
from midastouch_benchmark.trials.disturbances import Disturbance, Scene
from midastouch_benchmark.trials.sequence_trials import start_filter
from midastouch_benchmark.trials.trial import with_odometry
from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.filter import ParticleFilter
from midastouch_filter.policies import Policies, default_policies
from midastouch_filter.smoothing.reevaluation import Comparison


def comparisons(
    cache: Cache,
    mesh: ObjectMesh,
    touched: ObjectMesh,
    number: int,
    config: FilterConfig,
    disturb: Disturbance = disturbances.plain,
) -> Iterator[tuple[np.ndarray, Comparison]]:
    """Of a filter that knows one object, on slide `number` over that or another one; disturb, what happens to it.

    Each with the true pose (4, 4) of the sensor on the touched object, of the frame it belongs to.
    """
    made: list[Policies] = []

    def make_policies(*parts) -> Policies:
        made.append(default_policies(*parts))
        return made[-1]

    particle_filter = ParticleFilter(mesh, cache.codebook(mesh), config, number, make_policies=make_policies)
    frames = disturb(Scene(cache.frames(touched, number), np.random.default_rng(number), [], None)).frames
    start_filter(particle_filter, mesh, frames[0].truth, "uniform", 1.0)
    smoother, known = made[-1].refine, None
    for frame, odometry in with_odometry(frames):
        particle_filter.step(odometry, frame.measurement, elapsed=frame.seconds)
        particle_filter.deferred_update()  # else the comparison would be complete only in the next step
        if smoother.comparison is not None and smoother.comparison is not known:
            known = smoother.comparison
            yield frame.truth, known
