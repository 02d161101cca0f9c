"""How a sequence is evaluated: start of the filter, seeds, frames (paper sections 4.3 and 6)."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Iterator

import numpy as np

from midastouch_bringup.datasets import Sequence
from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.touch import measurement_of
from midastouch_filter.filter import ParticleFilter
from midastouch_perception.codebook import Codebook

from .setup import Networks, Untouched, untouched_of
from .trial import AnyFilter, TrialFrame, run_trial


@dataclasses.dataclass(frozen=True)
class TrialPlan:
    """init "paper" or "uniform"; beta, width of the paper's start; seeds, trials per sequence; every
    `stride`-th frame is used, at most `max_frames` of them."""

    init: str = "paper"
    beta: float = 1.0
    seeds: int = 10
    stride: int = 1
    max_frames: int | None = None

    def frame_indices(self, sequence: Sequence) -> list[int]:
        """Frames of the sequence that are processed."""
        return list(range(0, sequence.n_frames, self.stride))[: self.max_frames]


def start_filter(particle_filter: AnyFilter, mesh: ObjectMesh, truth: np.ndarray, init: str, beta: float) -> None:
    """Spread the particles: `uniform` over the surface without looking at the truth (4, 4) of frame 0, or as the paper
    does: N(truth, beta diag/3, beta 60 deg), projected to the surface."""
    if init == "uniform":
        particle_filter.initialise_uniform()
    else:
        sigma_t, sigma_r = beta * mesh.diagonal / 3, beta * np.radians(60)
        particle_filter.initialise_gaussian(truth, sigma_t, sigma_r)


def run_sequence(
    sequence: Sequence,
    mesh: ObjectMesh,
    codebook: Codebook,
    networks: Networks,
    config: FilterConfig,
    plan: TrialPlan,
    progress: Callable[[int], object] = lambda frames: None,
    untouched: Untouched | None = None,
) -> tuple[dict, list[dict]]:
    """All trials of one sequence: its entry under `sequences` of the JSON, and its `trials`.

    untouched: its no-contact image; None: as `untouched_of`.
    The seed of a trial is its number: 0, 1, ... Networks run anew in every trial, so that its times hold.
    `progress` is called with the number of frames done since the last call.
    """
    indices = plan.frame_indices(sequence)
    images = [sequence.image(i) for i in indices]
    untouched = untouched or untouched_of(sequence)
    particle_filter = ParticleFilter(mesh, codebook, config, clock=time.perf_counter)

    def trial(seed: int, observe) -> dict:
        particle_filter.reset(seed)
        start_filter(particle_filter, mesh, sequence.poses_true[indices[0]], plan.init, plan.beta)
        return run_trial(perceived(sequence, indices, images, untouched.image, networks), particle_filter, observe)

    trials = []
    for seed in range(plan.seeds):
        labels = {
            "sequence": sequence.name,
            "object": sequence.object_name,
            "seed": seed,
            "init": plan.init,
        }
        trials.append(labels | trial(seed, lambda *_: progress(1)))
    description = {
        "sequence": sequence.name,
        "object": sequence.object_name,
        "path": str(sequence.path),
        "layout": sequence.layout,
        "background": untouched.source,
        "mesh": str(mesh.path),
        "mesh_diagonal_m": mesh.diagonal,
        "codebook": dict(codebook.meta),
        "truth": np.round(se3.to_xyzquat(sequence.poses_true[indices]), 6),
    }
    return description, trials


def perceived(
    sequence: Sequence, indices: list[int], images: list[np.ndarray], background: np.ndarray, networks: Networks
) -> Iterator[TrialFrame]:
    """What networks without a memory of earlier frames make of the images (320, 240, 3) at these indices."""
    pipeline = networks.pipeline()
    for i, image in zip(indices, images, strict=True):
        felt = measurement_of(pipeline.process(image, background))
        yield TrialFrame(i, felt, pipeline.ms, sequence.poses_measured[i], sequence.poses_true[i])
