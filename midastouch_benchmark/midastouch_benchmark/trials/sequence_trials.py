"""Evaluation of a sequence: start of the filter, frames (paper sections 4.3 and 6)."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Iterable, Iterator

import numpy as np

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.object_model import symmetry_of
from midastouch_filter.core.touch import measurement_of
from midastouch_filter.filter import ParticleFilter
from midastouch_perception.codebook import Codebook
from midastouch_tools.datasets import Sequence

from .setup import Networks, Untouched
from .trial import AnyFilter, TrialFrame, run_trial
from .yardstick import Yardstick


@dataclasses.dataclass(frozen=True)
class TrialPlan:
    """Settings of trials. init: "paper" or "uniform"; beta: width of the paper's start; stride: every n-th frame is
    used; max_frames: at most so many of them."""

    init: str = "paper"
    beta: float = 1.0
    stride: int = 1
    max_frames: int | None = None

    def frame_indices(self, sequence: Sequence) -> list[int]:
        """Return the indices of the frames that are processed."""
        return list(range(0, sequence.n_frames, self.stride))[: self.max_frames]


def start_filter(particle_filter: AnyFilter, mesh: ObjectMesh, truth: np.ndarray, init: str, beta: float) -> None:
    """Spread the particles: `uniform` over the surface without looking at the truth (4, 4) of frame 0, or as the paper
    does: N(truth, beta diag/3, beta 60 deg), projected to the surface."""
    if init == "uniform":
        particle_filter.initialise_uniform()
    else:
        particle_filter.initialise_gaussian(truth, beta * mesh.diagonal / 3, beta * np.radians(60))


def run_sequence(
    sequence: Sequence,
    mesh: ObjectMesh,
    codebook: Codebook,
    networks: Networks,
    config: FilterConfig,
    plan: TrialPlan,
    untouched: Untouched,
    progress: Callable[[int], object] = lambda frames: None,
) -> tuple[dict, dict]:
    """Run the filter over one sequence; return the entries under `sequences` and `trials` of the JSON.

    untouched: its no-contact image. progress: called with the number of frames done since the last call.
    """
    indices = plan.frame_indices(sequence)
    images = [sequence.image(i) for i in indices]
    particle_filter = ParticleFilter(mesh, codebook, config, clock=time.perf_counter)
    yardstick = Yardstick.of(mesh, symmetry_of(mesh, codebook).exact)
    start_filter(particle_filter, mesh, sequence.poses_true[indices[0]], plan.init, plan.beta)
    frames = perceived(sequence, indices, images, untouched.image, networks)
    labels = {"sequence": sequence.name, "object": sequence.object_name, "init": plan.init}
    trial = labels | run_trial(frames, particle_filter, lambda *_: progress(1), yardstick)
    description = {
        "sequence": sequence.name,
        "object": sequence.object_name,
        "path": str(sequence.path),
        "layout": sequence.layout,
        "dropped_frames": sequence.dropped_frames,
        "background": untouched.source,
        "mesh": str(mesh.path),
        "mesh_diagonal_m": mesh.diagonal,
        "codebook": dict(codebook.meta),
        "truth": np.round(se3.to_xyzquat(sequence.poses_true[indices]), 6),
    }
    return description, trial


def perceived(
    sequence: Sequence, indices: list[int], images: list[np.ndarray], background: np.ndarray, networks: Networks
) -> Iterator[TrialFrame]:
    """Yield the frames that networks without memory of earlier ones read from the images (320, 240, 3) at `indices`."""
    pipeline = networks.pipeline()
    for i, image in zip(indices, images, strict=True):
        measurement = measurement_of(pipeline.process(image, background))
        yield TrialFrame(i, measurement, pipeline.ms, sequence.poses_measured[i], sequence.poses_true[i])


_NEAR, _FAR = 5e-3, 20e-3  # m: gel is pressed 2 mm deep, and trackers are some millimetres off, but not so far
_MESH_FRAME = {"tactile_tracking": "the gel frame of the trial's first image"}


def mesh_doubt(sequence: Sequence, indices: list[int], mesh: ObjectMesh) -> str:
    """Return a warning if a mesh is some millimetres off the true poses of these frames; empty if it is near.

    Raises InputError if it is so far off that the sensor cannot have touched it there.
    """
    _, distances, _ = mesh.closest_points(sequence.poses_true[indices][:, :3, 3])
    off = float(np.median(distances))
    if off <= _NEAR:
        return ""
    frame = _MESH_FRAME.get(sequence.layout, "the object's frame of the recording")
    said = f"{sequence.path}: the true poses are {1e3 * off:.0f} mm off the surface of {mesh.name} (median)"
    if off > _FAR:
        raise InputError(f"{said}, so it is not touched there; give the mesh in metres in {frame}")
    return f"{said}; is the mesh in {frame}?"


PAPER_REAL_BETA = 0.5
"""Width of the paper's starts on real slides."""
PAPER_REAL = {
    "trials": 500,
    "e_trans_mm": 19.7,
    "e_rot_deg": 21.5,
    "min_cluster_trans_mm": 11.1,
    "min_cluster_rot_deg": 10.8,
}
"""Fifty slides over ten objects, ten starts each: mean final error of the particles, median of the closest mode's."""


def require_real(sequences: Iterable[Sequence]) -> None:
    """Raise InputError naming the first sequence that is not a real one of YCB-Slide."""
    for sequence in sequences:
        if sequence.layout != "real":
            raise InputError(
                f"{sequence.path}: not a real slide of YCB-Slide; get them: midastouch download ycb-slide real"
            )
