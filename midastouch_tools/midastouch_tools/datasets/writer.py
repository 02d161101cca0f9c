"""Writing of a slide in YCB-Slide's simulated layout, for its tools and for this package's reader."""

from __future__ import annotations

import pickle
from collections.abc import Iterable
from pathlib import Path

import cv2
import numpy as np

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.files import atomic_path
from midastouch_perception.sensor_model import SensorModel

from .sequence import IMAGE_SHAPE
from .ycb_slide import BACKGROUND_FILE, HEIGHT_UNIT, PENETRATION_FILE

_JPEG_QUALITY = 95
_CONTACT = 1e-6  # m


def write_sequence(
    path: str | Path,
    frames: Iterable[tuple[np.ndarray, np.ndarray]],
    poses_true: np.ndarray,
    poses_measured: np.ndarray,
    *,
    background: np.ndarray,
    object_name: str,
    sensor: SensorModel,
    noise: dict[str, float],
) -> None:
    """Write a sequence to a folder; it appears complete or not at all.

    Parameters
    ----------
    path
    frames
        Image (320, 240, 3) uint8 RGB and penetration (320, 240) [m] per frame; taken one at a time.
    poses_true, poses_measured : `T_obj_gel` (N, 4, 4)
    background : (320, 240, 3) uint8 RGB
    object_name
    sensor
        Model the images were made with; its name and its camera poses are written too.
    noise
        Standard deviations of the measured poses, `sig_t` [m] and `sig_r` [deg].

    Raises
    ------
    InputError
        The path holds anything but a sequence, or frames and poses differ in number.
    """
    path = Path(path)
    if path.exists() and not (path / "tactile_data.pkl").is_file() and (not path.is_dir() or any(path.iterdir())):
        raise InputError(f"{path}: exists and is not a sequence; choose another folder")
    with atomic_path(path) as folder:
        penetrations = _write_frames(path, folder, frames, sensor)
        n = len(penetrations)
        if not n == len(poses_true) == len(poses_measured) or n == 0:
            raise InputError(
                f"{path}: {n} frames, {len(poses_true)} true and {len(poses_measured)} measured poses; "
                "a sequence needs one of each per frame"
            )
        np.savez_compressed(folder / PENETRATION_FILE, frames=np.arange(n), penetration_um=np.stack(penetrations))
        write_image(folder / BACKGROUND_FILE, background)
        camera_from_gel = se3.translation([0, 0, sensor.gel_distance])
        data = {
            "gelposes": se3.to_xyzquat(poses_true),
            "camposes": se3.to_xyzquat(poses_true @ camera_from_gel),
            "gelposes_meas": se3.to_xyzquat(poses_measured),
            "mNoise": {key: float(value) for key, value in noise.items()},
            "object_name": object_name,
            "sensor": sensor.name,
        }
        (folder / "tactile_data.pkl").write_bytes(pickle.dumps(data, protocol=4))


def _write_frames(
    path: Path, folder: Path, frames: Iterable[tuple[np.ndarray, np.ndarray]], sensor: SensorModel
) -> list[np.ndarray]:
    """Write images, heights and contact masks; return penetrations (320, 240) int16 um. Errors name `path`."""
    for name in ("tactile_images", "gt_heightmaps", "gt_contactmasks"):
        (folder / name).mkdir(parents=True)
    dome, penetrations = sensor.gel_distance - sensor.gel_depth, []
    for i, (image, penetration) in enumerate(frames):
        if image.shape != IMAGE_SHAPE or penetration.shape != IMAGE_SHAPE[:2]:
            raise InputError(f"{path}: frame {i} is {image.shape}, {penetration.shape}; expected 320 x 240")
        heights = np.clip(np.round((penetration + dome) / HEIGHT_UNIT), 0, 255).astype(np.uint8)
        write_image(folder / "tactile_images" / f"{i}.jpg", image)
        write_image(folder / "gt_heightmaps" / f"{i}.jpg", heights)
        write_image(folder / "gt_contactmasks" / f"{i}.jpg", (penetration > _CONTACT).astype(np.uint8) * 255)
        penetrations.append(np.round(penetration * 1e6).astype(np.int16))
    return penetrations


def write_image(file: Path, image: np.ndarray) -> None:
    """Write an image (H, W) or (H, W, 3) uint8, grey or RGB; raises OSError where OpenCV only returns False."""
    bgr = cv2.cvtColor(image, cv2.COLOR_RGB2BGR) if image.ndim == 3 else image
    options = [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY] if file.suffix == ".jpg" else []
    if not cv2.imwrite(str(file), bgr, options):
        raise OSError(f"{file}: could not be written; is the disk full?")
