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
from midastouch_simulation.grasp import simulate_grasp
from midastouch_simulation.optics import TactoOptics
from midastouch_simulation.simulated_digit import SimulatedCamera
from midastouch_simulation.slide import Leap, measure_poses, simulate_slide

from ..progress import progress_bar
from . import write_sequence

_CACHE = Path("out/cache/slides")
_CHUNK = 16  # frames made at a time: bounds memory
NOISE_T, NOISE_R = 5e-4, np.radians(1.0)
"""Standard deviations [m, rad] of the measured poses (paper section 5)."""


def no_contact_image(sensor: SensorModel, rng: np.random.Generator) -> np.ndarray:
    """Return the image (H, W, 3) uint8 RGB of the untouched gel of an invented DIGIT.

    As on real sensors, a grey gel darkens towards its borders and is lit red from the left, green from the
    right and blue from below; each LED differs a little.
    """
    y, x = np.mgrid[1 : -1 : sensor.height * 1j, -1 : 1 : sensor.width * 1j]
    grey = rng.uniform(85, 115) * (1 - 0.3 * (x**2 + y**2) / 2)
    image = np.repeat(grey[..., None], 3, axis=2)
    for channel, (centre_x, centre_y) in enumerate(((-0.7, 0.15), (0.75, 0.0), (0.0, -0.9))):
        shift_x, shift_y = rng.normal(0, 0.12, 2)
        spread = rng.uniform(0.35, 0.6)
        lobe = np.exp(-((x - centre_x - shift_x) ** 2 + (0.6 * (y - centre_y - shift_y)) ** 2) / spread)
        image[..., channel] += rng.uniform(30, 60) * lobe
        image -= rng.uniform(5, 15) * lobe[..., None]
    return np.clip(image, 0, 255).astype(np.uint8)


class TactoCamera:
    """A DIGIT with the optics of TACTO; `background` (H, W, 3) uint8 RGB is its no-contact image."""

    def __init__(self, sensor: SensorModel, rng: np.random.Generator):
        self.background = no_contact_image(sensor, rng)
        self._optics = TactoOptics(sensor)

    def image(self, penetration: np.ndarray, normals: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Return the image (H, W, 3) uint8 RGB of a penetration map (H, W) m with its surface normals (H, W, 3)."""
        return self._optics.image(penetration, self.background, rng, normals)


def camera_of(sensor: SensorModel, rng: np.random.Generator) -> TactoCamera | SimulatedCamera:
    """Return the camera of a sensor by its model's light: added to the no-contact image, or relative to it."""
    if sensor.light == "additive":
        return TactoCamera(sensor, rng)
    return SimulatedCamera(sensor, no_contact_image(sensor, rng), rng)


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
