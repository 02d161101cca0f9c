"""The filter alone over very many steps: rotations stay rotations, memory and time per step stay what they are."""

from __future__ import annotations

import os
import time
from dataclasses import replace

import numpy as np
from slide import Slide

from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.state import STATES
from midastouch_filter.core.touch import Measurement, reduced_penetration
from midastouch_filter.filter import ParticleFilter
from midastouch_perception.codebook import Codebook
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tcn import load_tcn
from midastouch_simulation.slide import measure_poses
from midastouch_tools.processes.process import resident_mb

PARTS = 20
RELIEF_EVERY = 4  # steps; the others are quick, so that there can be many


def touches(slide: Slide, mesh: ObjectMesh) -> list[Measurement]:
    """What is measured at each pose of the slide."""
    sensor = SensorModel.load("digit_tacto")
    penetration = PenetrationRenderer(mesh, sensor.for_maps).render(slide.poses)
    codes = load_tcn("fast", sensor).encode(penetration)
    return [
        Measurement(True, code, 1e-5, "", reduced_penetration(p)) for code, p in zip(codes, penetration, strict=True)
    ]


def far_from_rotations(poses: np.ndarray) -> float:
    """Largest deviation of R^T R from the identity."""
    rotation = poses[..., :3, :3]
    return float(np.abs(np.swapaxes(rotation, -1, -2) @ rotation - np.eye(3)).max())


def test_many_steps(slide, minutes, figures):
    """To and fro over a slide with noisy odometry; now and then lifted, carried away, or fed with what is no touch."""
    steps = round(10_000 * minutes) if minutes else 200
    mesh = ObjectMesh.load(slide.mesh)
    seen = touches(slide, mesh)
    config = FilterConfig(max_particles=5000, threads=1)
    running = ParticleFilter(mesh, Codebook.load(slide.codebook, mesh=mesh), config, 0)
    last = len(slide.poses) - 1
    states = dict.fromkeys(STATES, 0)
    cpu_ms, resident, worst = [], [], 0.0
    parts = np.array_split(np.arange(steps), PARTS)
    for part in (*parts, parts[0]):  # at the end as at the beginning: what a step costs depends on what is believed
        if part[0] == 0:
            rng, before = np.random.default_rng(0), None
            running.initialise_gaussian(slide.poses[0], 5e-3, 0.2)
        started = time.process_time()
        for i in part:
            k = last - abs(i % (2 * last) - last)
            measured = measure_poses(slide.poses[k : k + 1], rng, 2e-4, 0.005)[0]
            odometry = None if before is None else se3.inverse(before) @ measured
            touch = seen[k] if i % RELIEF_EVERY == 0 else replace(seen[k], penetration=None)
            event = rng.integers(1000)
            if event < 20:
                touch = Measurement(False)
            elif event < 25:
                touch = Measurement(True, np.full(len(seen[k].code), np.nan))
            elif event == 25:
                odometry = se3.exp([10.0, 0, 0, 0, 0, 0])
            before = measured
            estimate = running.step(odometry, touch)
            states[estimate.status.state] += 1
        cpu_ms.append(1e3 * (time.process_time() - started) / len(part))
        resident.append(resident_mb(os.getpid()))
        poses = np.concatenate([running.poses, [mode.pose for mode in estimate.modes]])
        assert np.isfinite(poses).all()
        assert np.isfinite(running.weights).all()
        worst = max(worst, far_from_rotations(poses))
    figures["filter"] = {
        "steps": steps,
        "orthonormality": worst,
        "cpu_ms_per_step": {"first_part": cpu_ms[0], "first_part_again": cpu_ms[-1]},
        "resident_mb": {"after_first_part": resident[0], "growth": resident[-1] - resident[0]},
        "states": states,
    }
    assert worst < 1e-9
    assert states["converged"] > 0
    if minutes:
        assert cpu_ms[-1] < 1.3 * cpu_ms[0]
        assert resident[-1] - resident[1] < 20
