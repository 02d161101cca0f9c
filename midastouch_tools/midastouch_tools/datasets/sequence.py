"""One sliding sequence, in any of the layouts on disk."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np

from midastouch_common.errors import InputError
from midastouch_common.images import read_image_file

IMAGE_SHAPE = (320, 240, 3)
_ASPECT_ERROR = 0.02


@dataclass(frozen=True)
class Sequence:
    """Posed tactile images of one slide over one object; images are read when asked for.

    Attributes:
        path: the folder it was read from.
        name: the last two parts of that path, such as `035_power_drill/00`.
        object_name: name of the object touched.
        layout: `simulated`, `real` or `tactile_tracking`.
        sensor: name of the sensor model of its images.
        image_paths: one file per frame.
        stamps_ns: (N,) int64, increasing, nanoseconds; never 0, which ROS reads as "no time".
        poses_true: (N, 4, 4) T_obj_gel from ground truth.
        poses_measured: (N, 4, 4) T_obj_gel as the robot knows it: the source of odometry. Equal to
            `poses_true` except in the simulated layout: the only real poses are the tracker's.
        dropped_frames: frames on disk left out because their pose is missing or jumps.
    """

    path: Path
    object_name: str
    layout: str
    sensor: str
    image_paths: tuple[Path, ...]
    stamps_ns: np.ndarray
    poses_true: np.ndarray
    poses_measured: np.ndarray
    background_path: Path | None = None
    dropped_frames: int = 0
    penetration_sources: Mapping[int, Callable[[], np.ndarray]] = field(default_factory=dict, repr=False)

    @property
    def name(self) -> str:
        return "/".join(self.path.resolve().parts[-2:])

    @property
    def n_frames(self) -> int:
        return len(self.stamps_ns)

    def image(self, i: int) -> np.ndarray:
        """Tactile image of frame `i`: (320, 240, 3) uint8 RGB. Raises InputError if it cannot be read."""
        return read_image(self.image_paths[i])

    @property
    def background(self) -> np.ndarray | None:
        """The sensor's no-contact image (320, 240, 3) uint8 RGB, None if the sequence has none."""
        return None if self.background_path is None else self.read_background(self.background_path)

    def read_background(self, path: Path) -> np.ndarray:
        """Read a no-contact image of the same sensor, in the form of `image`."""
        return read_image(path)

    @property
    def ground_truth_frames(self) -> tuple[int, ...]:
        """Frames whose penetration map is known."""
        return tuple(sorted(self.penetration_sources))

    def penetration_truth(self, i: int) -> np.ndarray | None:
        """True penetration map (320, 240) float32, metres, of frame `i`; None if it is not known."""
        source = self.penetration_sources.get(i)
        return None if source is None else source()


@dataclass(frozen=True)
class VideoSequence(Sequence):
    """A sequence whose images came out of one video. images: (320, 240, 3) uint8 RGB each; no `image_paths`."""

    images: tuple[np.ndarray, ...] = field(default=(), repr=False)

    def image(self, i: int) -> np.ndarray:
        """Tactile image of frame `i`: (320, 240, 3) uint8 RGB."""
        return self.images[i]

    def read_background(self, path: Path) -> np.ndarray:
        """Read a no-contact image of the same sensor; a landscape one, as in the video, is turned upright."""
        image = read_image_file(path)
        return _upright(image, path) if image.shape[0] > image.shape[1] else portrait(image, path)


def portrait(image: np.ndarray, path: Path) -> np.ndarray:
    """Turn a landscape image (h, w, 3) uint8 BGR of the file `path` counter-clockwise, to (320, 240, 3) uint8 RGB.

    Raises InputError if it is not 4:3.
    """
    height, width, _ = IMAGE_SHAPE
    if abs(image.shape[1] / image.shape[0] * width / height - 1) > _ASPECT_ERROR:
        raise InputError(f"{path}: image is {image.shape[1]} x {image.shape[0]}, expected 4:3 as 320 x 240; crop it")
    turned = cv2.rotate(cv2.cvtColor(image, cv2.COLOR_BGR2RGB), cv2.ROTATE_90_COUNTERCLOCKWISE)
    return turned if turned.shape == IMAGE_SHAPE else cv2.resize(turned, (width, height), interpolation=cv2.INTER_AREA)


def read_image(path: Path) -> np.ndarray:
    """Read a DIGIT image file as (320, 240, 3) uint8 RGB; InputError if missing, damaged or of another size."""
    return _upright(read_image_file(path), path)


def _upright(image: np.ndarray, path: Path) -> np.ndarray:
    if image.shape != IMAGE_SHAPE:
        raise InputError(
            f"{path}: image is {image.shape[1]} x {image.shape[0]}, expected a portrait image of 240 x 320; "
            "rotate or scale it"
        )
    return cv2.cvtColor(image, cv2.COLOR_BGR2RGB)
