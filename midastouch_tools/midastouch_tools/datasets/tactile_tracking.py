"""Reading of trials of TactileTracking, the recordings of NormalFlow (Huang, Kaess, Yuan, RA-L 2024).

A GelSight Mini on fixed objects, under motion capture. A trial is a folder named by object and number (`avocado0`) that
holds `gelsight.avi` and `true_start_T_currs.npy`; its third-person video and maps derived from the images are not read.
Every image shows contact; if you have a no-contact image of the sensor, put it there as `background.png`.
Source of the layout: the dataset's card and the readers of its authors (rpl-cmu/normalflow,
rpl-cmu/normalflow_experiment).
"""

from __future__ import annotations

import re
from pathlib import Path

import cv2
import numpy as np

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.files import require_file
from midastouch_common.message_arrays import SECOND

from . import restricted_pickle
from .sequence import VideoSequence, portrait

VIDEO_FILE, POSE_FILE, BACKGROUND_FILE = "gelsight.avi", "true_start_T_currs.npy", "background.png"
_RATE_RANGE = (1.0, 240.0)  # Hz a recording can have
_ROTATION_TOLERANCE = 1e-3
_LARGEST_DISTANCE = 1.0  # m from the start: objects are some centimetres
_START_ERRORS = 1e-3, 1e-2  # m, and entries of the rotation, by which the first pose may differ from the identity

# The authors' sensor frame lies in the gel: x right and y down in the landscape image, z into the object. Our frame is
# that of the image turned counter-clockwise to portrait: its x (right) was down, its y (up) was right, z to the camera.
_SENSOR_FROM_GEL = se3.make(np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]]), np.zeros(3))


def load_trial(path: Path) -> VideoSequence:
    """Load the trial in folder `path`; the gel frame of its first image is the object frame, as it has no mesh.

    Raises InputError for files that are missing, damaged or disagree in number.
    """
    images, rate = _video(path / VIDEO_FILE)
    poses = _poses(path / POSE_FILE)
    if len(poses) != len(images):
        raise InputError(
            f"{path / POSE_FILE}: {len(poses)} poses for {len(images)} images of {VIDEO_FILE}; get the trial again"
        )
    poses = se3.inverse(_SENSOR_FROM_GEL[None]) @ poses @ _SENSOR_FROM_GEL
    return VideoSequence(
        path=path,
        object_name=re.sub(r"\d+$", "", path.resolve().name),
        layout="tactile_tracking",
        sensor="gelsight_mini",
        image_paths=(),
        stamps_ns=SECOND + np.round(np.arange(len(poses)) * (SECOND / rate)).astype(np.int64),
        poses_true=poses,
        poses_measured=poses,
        images=images,
        background_path=background if (background := path / BACKGROUND_FILE).is_file() else None,
    )


def _video(path: Path) -> tuple[tuple[np.ndarray, ...], float]:
    """Return the images of a video, (320, 240, 3) uint8 RGB each, and its nominal rate [Hz]; it has no stamps."""
    capture = cv2.VideoCapture(str(require_file(path, "tactile video")))
    rate, images = capture.get(cv2.CAP_PROP_FPS), []
    while (read := capture.read())[0]:
        images.append(portrait(read[1], path))
    capture.release()
    if not images:
        raise InputError(f"{path}: no readable image in it; get the file again")
    if not _RATE_RANGE[0] <= rate <= _RATE_RANGE[1]:
        raise InputError(f"{path}: {rate:g} images a second cannot be; get the file again")
    return tuple(images), rate


def _poses(file: Path) -> np.ndarray:
    """Return T_start_sensor (N, 4, 4) float64, metres."""
    poses = np.asarray(restricted_pickle.load_npy(require_file(file, "poses")))
    if poses.ndim != 3 or poses.shape[1:] != (4, 4) or not len(poses) or poses.dtype.kind != "f":
        raise InputError(f"{file}: poses of shape {poses.shape} and type {poses.dtype}, expected (N, 4, 4) numbers")
    poses = poses.astype(float)
    if problem := _pose_problem(poses):
        raise InputError(f"{file}: {problem}")
    return poses


def _pose_problem(poses: np.ndarray) -> str:
    """Return why poses (N, 4, 4) cannot be the sensor's in its own first frame, and the fix; empty if they can."""
    if not np.isfinite(poses).all():
        return "holds values that are no pose; get the file again"
    if np.abs(poses[:, 3] - [0, 0, 0, 1]).max() > _ROTATION_TOLERANCE:
        return "the last row of a pose is not 0 0 0 1, so it is no pose; were the matrices transposed?"
    rotations = poses[:, :3, :3]
    if np.abs(rotations @ rotations.transpose(0, 2, 1) - np.eye(3)).max() > _ROTATION_TOLERANCE:
        return "holds values that are no pose: no rotation without scale; get the file again"
    if np.linalg.det(rotations).min() < 0:
        return "a rotation mirrors, which no sensor can do; give poses of right-handed frames"
    if (furthest := np.linalg.norm(poses[:, :3, 3], axis=1).max()) > _LARGEST_DISTANCE:
        return f"{furthest:.0f} m from the start; are these millimetres? Scale translations by 0.001 to metres"
    distance, turn = np.linalg.norm(poses[0, :3, 3]), np.abs(poses[0, :3, :3] - np.eye(3)).max()
    if distance > _START_ERRORS[0] or turn > _START_ERRORS[1]:
        return "the first pose is not the identity; give all poses in the frame of the first, inv(first) @ pose"
    return ""
