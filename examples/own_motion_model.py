"""Localise with a motion model of your own: here one for a finger that slips in its mount.

midastouch simulate handle_tool --seed 3 --out out/slide
midastouch build-codebook handle_tool
python examples/own_motion_model.py out/slide
"""

import time

import numpy as np
from localise_offline import localise, run

from midastouch_bringup.datasets import load_sequence
from midastouch_filter import (
    FilterConfig,
    MotionModel,
    Odometry,
    ParticleFilter,
    Particles,
    Policies,
    Propagation,
    Workers,
    default_policies,
)
from midastouch_perception import Codebook, ObjectMesh, TouchPipeline, bundled_objects, load_tcn, load_tdn

SLIP = 0.1  # sigma of the fraction of the motion that is lost or gained


class SlippingMount(MotionModel):
    """The finger moves more or less than the arm says, in the direction in which it moves."""

    def __init__(self, config: FilterConfig, rng: np.random.Generator, workers: Workers):
        super().__init__(config, rng, workers)
        self._rng = rng

    def propagate(self, particles: Particles, odometry: Odometry, exploration: float) -> None:
        before = particles.positions.copy()
        super().propagate(particles, odometry, exploration)
        fraction = SLIP * self._rng.standard_normal((len(particles), 1), np.float32)
        particles.positions += fraction * (particles.positions - before)


def slipping_policies(config, noise, model, rng, gates, watch, workers) -> Policies:
    """The parts of a step as shipped, but for the first one."""
    parts = default_policies(config, noise, model, rng, gates, watch, workers)
    parts.propagate = Propagation(SlippingMount(config, rng, workers), config, gates)
    return parts


def main(folder: str = "out/slide", codebook_path: str = "out/codebooks/handle_tool.npz") -> None:
    """Print where the sensor ends."""
    slide = load_sequence(folder)
    mesh = ObjectMesh.load(bundled_objects()[slide.object_name])
    particle_filter = ParticleFilter(mesh, Codebook.load(codebook_path, mesh), make_policies=slipping_policies)
    pipeline = TouchPipeline(load_tdn(), load_tcn(), time.perf_counter)
    *_, last = localise(slide, pipeline, particle_filter)
    error = np.linalg.norm(last.pose[:3, 3] - slide.poses_true[-1, :3, 3])
    print(f"{last.status.state}, {1e3 * error:.1f} mm off: {last.status.reason}")


if __name__ == "__main__":
    run(main, __doc__)
