"""A simulated slide, or a grasp, as a sequence folder: path, images of a DIGIT, poses as a tracker measures them."""

from __future__ import annotations

import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from midastouch_common.mesh import ObjectMesh
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_model import SensorModel
from midastouch_simulation.camera import camera_of
from midastouch_simulation.grasp import simulate_grasp
from midastouch_simulation.slide import Leap, measure_poses, simulate_slide

from ..progress import progress_bar
from . import write_sequence

_CACHE = Path("out/cache/slides")
_CHUNK = 16  # frames made at a time: bounds memory
NOISE_T, NOISE_R = 5e-4, np.radians(1.0)
"""Standard deviations [m, rad] of the measured poses (paper section 5)."""


def simulate_sequence(
    mesh: ObjectMesh,
    sensor: SensorModel,
    length: float,
    seed: int,
    out: Path,
    progress: bool = False,
    leap: Leap | None = None,
) -> int:
    """Simulate a slide of `length` m over the mesh, write it to `out` and return the number of frames.

    One seed fixes the path, the sensor's noise, its no-contact image and the measured poses.
    """
    rng = np.random.default_rng(seed)
    poses = simulate_slide(mesh, sensor, length, rng, leap=leap)
    _write(mesh, sensor, poses, rng, out, progress)
    return len(poses)


def simulate_grasp_sequence(mesh: ObjectMesh, sensor: SensorModel, seed: int, out: Path, progress: bool) -> None:
    """Simulate a grasp of the mesh and write it to `out`: a frame for each contact.

    One seed fixes the same things as for a slide; every finger has the same sensor.
    """
    rng = np.random.default_rng(seed)
    _write(mesh, sensor, simulate_grasp(mesh, sensor, rng), rng, out, progress)


def simulate_pinches(mesh: ObjectMesh, sensor: SensorModel, seed: int, finger: int, count: int, out: Path) -> None:
    """Simulate pinches by two fingers and write to `out` what one of them, 0 or 1, feels: a frame for each pinch.

    One seed fixes the pinches; each finger has a sensor of its own.
    """
    rng = np.random.default_rng(seed)
    poses = np.stack([simulate_grasp(mesh, sensor, rng, contacts=2)[finger] for _ in range(count)])
    _write(mesh, sensor, poses, rng.spawn(2)[finger], out, True)


def _write(
    mesh: ObjectMesh, sensor: SensorModel, poses: np.ndarray, rng: np.random.Generator, out: Path, progress: bool
) -> None:
    """Write a sequence of images and measured poses at the true poses (N, 4, 4)."""
    measured = measure_poses(poses, rng, NOISE_T, NOISE_R)
    camera = camera_of(sensor, rng)
    renderer = PenetrationRenderer(mesh, sensor)
    # a generator per image, so that the order in which threads draw does not matter
    noises = rng.spawn(len(poses))
    bar = progress_bar(total=len(poses), unit="frame", desc=f"touches of {mesh.name}", disable=not progress)

    def frames() -> Iterator[tuple[np.ndarray, np.ndarray]]:
        with bar, ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
            for start in range(0, len(poses), _CHUNK):
                chunk = slice(start, start + _CHUNK)
                penetration, normals = renderer.render_with_normals(poses[chunk])
                images = pool.map(camera.image, penetration, normals, noises[chunk])
                for frame in zip(images, penetration, strict=True):
                    yield frame
                    bar.update()

    write_sequence(
        out,
        frames(),
        poses,
        measured,
        background=camera.background,
        object_name=mesh.name,
        sensor=sensor,
        noise={"sig_t": NOISE_T, "sig_r": float(np.degrees(NOISE_R))},
    )


def cached_slide(mesh: ObjectMesh, sensor: SensorModel, length: float, seed: int = 0) -> Path:
    """Return the folder of the slide with this seed; simulate it if no earlier call has done so."""
    kind = f"{sensor.content_id}_{sensor.light}"
    folder = _CACHE / mesh.name / f"{mesh.sha256[:8]}_{kind}_{1e3 * length:.0f}mm_{seed}"
    if not folder.is_dir():
        simulate_sequence(mesh, sensor, length, seed, folder, progress=True)
    return folder
