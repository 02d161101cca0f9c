"""Small sequences made on the spot, in the exact layouts of YCB-Slide: fixtures of several packages."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import pytest

from midastouch_common import se3
from midastouch_perception.sensor_model import SensorModel
from midastouch_tools.datasets import Sequence as SimulatedSlide
from midastouch_tools.datasets import load_sequence, write_sequence


def smooth_poses(n: int, rng: np.random.Generator) -> np.ndarray:
    """A slide of 2 mm and a small turn per frame, (N, 4, 4)."""
    start = se3.make(se3.random_rotations(1, rng)[0], rng.uniform(-0.1, 0.1, 3))
    steps = np.arange(n)[:, None] * np.array([0.002, 0, 0, 0, 0, 0.03])
    return start @ se3.exp(steps)


def smooth_image(i: int) -> np.ndarray:
    """An image that JPEG keeps within a few grey levels and that differs between frames and channels."""
    rows, columns = np.mgrid[:320, :240] / 320
    image = np.stack([rows, columns, np.full_like(rows, (i % 10) / 10)], axis=2)
    return (40 + 170 * image).astype(np.uint8)


def bump(i: int) -> np.ndarray:
    """A round press (320, 240), metres, that moves from frame to frame."""
    rows, columns = np.mgrid[:320, :240]
    distance = np.hypot(rows - 160, columns - 60 - 10 * i)
    return np.maximum(0, 1e-3 * (1 - (distance / 40) ** 2)).astype(np.float32)


def write_slide(
    path: Path, images: Sequence[np.ndarray], poses: np.ndarray, depths=None, measured=None, background=None
) -> SimulatedSlide:
    """A simulated slide over what the folder above is named after; no touches and no noise unless given."""
    write_sequence(
        path,
        zip(images, depths or [np.zeros((320, 240), np.float32)] * len(images), strict=True),
        poses,
        poses if measured is None else measured,
        background=images[0] if background is None else background,
        object_name=path.parent.name,
        sensor=SensorModel.load("digit_tacto"),
        noise={"sig_t": 5e-4, "sig_r": 1.0},
    )
    return load_sequence(path)


def write_touches(path: Path, n: int, seed: int = 0) -> SimulatedSlide:
    """A simulated slide of `n` bumps, measured with noise."""
    rng = np.random.default_rng(seed)
    poses = smooth_poses(n, rng)
    measured = poses @ se3.exp(rng.normal(0, [5e-4] * 3 + [0.01] * 3, (n, 6)))
    images, depths = [smooth_image(i) for i in range(n)], [bump(i) for i in range(n)]
    return write_slide(path, images, poses, depths, measured, np.full((320, 240, 3), 90, np.uint8))


@pytest.fixture
def simulated_sequence(tmp_path: Path):
    """Factory of simulated sequences of `n` frames, written by the package's own writer."""
    return lambda n=5, seed=0, name="test_object": write_touches(tmp_path / name / "00", n, seed)


def write_real(folder: Path, n: int = 21, seed: int = 0, edit=None) -> tuple[Path, np.ndarray]:
    """A real sequence; returns its folder and the truth.

    Everything follows the published layout: frames of seven digits at 30 Hz, `synced_data.npy` with a pickled
    dictionary, poses in the tracker's world, `alignment.npy` one level up.
    """
    rng = np.random.default_rng(seed)
    path = folder / "035_power_drill" / "dataset_0"
    (path / "frames").mkdir(parents=True)
    names = [f"frame_{i:07d}.jpg" for i in range(n)]
    for i, name in enumerate(names):
        cv2.imwrite(str(path / "frames" / name), cv2.cvtColor(smooth_image(i), cv2.COLOR_RGB2BGR))
    object_from_gel = smooth_poses(n, rng)
    alignment = se3.exp(rng.normal(0, 0.02, 6))
    # undo what the reader does: gel -> camera, then the translation that the alignment adds
    object_from_digit = object_from_gel @ se3.translation([0, 0, 0.022])
    object_from_digit[:, :3, 3] -= alignment[:3, 3]
    world_from_object = np.repeat(se3.exp(rng.normal(0, 1, 6))[None], n, axis=0)
    data = {
        "start_time": "2022-05-09 14:00:00",
        "timestamps": [i / 30 for i in range(n)],
        "digit_frames": [f"frames/{name}" for name in names],
        "webcam_frames": [f"webcam_frames/{name}" for name in names],
        "poses": {
            "DIGIT": se3.to_xyzquat(world_from_object @ object_from_digit),
            "035_power_drill": se3.to_xyzquat(world_from_object),
        },
    }
    if edit is not None:
        edit(data)
    np.save(path / "synced_data.npy", data, allow_pickle=True)
    np.save(path.parent / "alignment.npy", alignment)
    return path, object_from_gel


@pytest.fixture
def real_sequence_folder(tmp_path: Path):
    """Factory of real sequences; returns the folder and the truth."""
    return partial(write_real, tmp_path)


def write_video(path: Path, images: Sequence[np.ndarray]) -> Path:
    """A video of 25 BGR images per second; its path."""
    height, width = images[0].shape[:2]
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 25, (width, height))
    assert writer.isOpened()
    for image in images:
        writer.write(image)
    writer.release()
    return path
