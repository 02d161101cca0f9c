"""No-contact images from files, and storage of each sensor's image and calibration between starts of a node."""

from __future__ import annotations

import os
from pathlib import Path

import cv2
import numpy as np

from midastouch_common.errors import InputError
from midastouch_common.files import atomic_path, expanded
from midastouch_common.images import image_files, read_image_file
from midastouch_common.names import require_name

from ..sensor_calibration.calibration import SensorCalibration
from ..sensor_model import DIGIT_LAMPS, SensorModel
from .background import MOST_DOUBTFUL, RunningBackground, doubtful_fraction, estimate_background
from .colour_layout import image_problem, shipped_layout
from .gel_view import view_problem

_MOST_FILES = 200


def read_background(path: str | Path, height: int, width: int) -> np.ndarray:
    """Read a no-contact image from a file, or estimate it from a folder of a sensor's images.

    Parameters
    ----------
    path
    height, width : size that it must have [pixels]

    Returns
    -------
    (height, width, 3) uint8 RGB

    Raises
    ------
    InputError
        The path is missing, the folder has no images, an image is incomplete or of another size, or the images show
        contacts at the same pixels too often to show the untouched gel there.
    """
    path = Path(path)
    if not path.is_dir():
        return _read_image(path, height, width)
    files = image_files(path)
    if not files:
        raise InputError(f"{path}: no PNG or JPEG images in this folder to estimate a background from")
    chosen = files[:: -(-len(files) // _MOST_FILES)]
    images = [_read_image(file, height, width) for file in chosen]
    background = estimate_background(images)
    doubt = doubtful_fraction(images, background)
    if doubt > MOST_DOUBTFUL:
        raise InputError(
            f"{path}: {100 * doubt:.0f} % of the image is touched in most of these images; "
            "give images without contact, or a slide with longer pauses"
        )
    return background


def _read_image(path: Path, height: int, width: int) -> np.ndarray:
    if not path.exists():
        raise InputError(f"{path}: no such image, nor a folder of images; leave the parameter empty to estimate one")
    image = read_image_file(path)
    if image.shape[:2] != (height, width):
        raise InputError(f"{path}: {image.shape[1]} x {image.shape[0]} pixels, the sensor model has {width} x {height}")
    return cv2.cvtColor(image, cv2.COLOR_BGR2RGB)


def default_folder() -> Path:
    """Return the default folder of backgrounds: below $ROS_HOME, or ~/.ros, where ROS nodes keep their data."""
    return expanded(os.environ.get("ROS_HOME") or "~/.ros", "ROS_HOME") / "midastouch" / "backgrounds"


def store_of(folder: str, serial: str) -> BackgroundStore | None:
    """Return the store that a node's parameters name; None without a serial number.

    Parameters
    ----------
    folder
        Empty for the default folder.
    serial
        Serial number of the sensor.
    """
    if not serial:
        return None
    return BackgroundStore(expanded(folder, "background_folder") if folder else default_folder(), serial)


class BackgroundStore:
    """Store of one sensor's no-contact image in a folder, as `SERIAL.png`, and of its calibration next to it.

    Raises InputError for a serial number that cannot be a file's name.
    """

    def __init__(self, folder: Path, serial: str):
        require_name("serial number", serial, "serial")
        self.path = folder / f"{serial}.png"
        self.calibration_path = folder / f"{serial}.calibration.npz"
        self._serial = serial

    def load(self, height: int, width: int) -> np.ndarray | None:
        """Read the RGB image (height, width, 3) uint8; None if none was kept. InputError as in `read_background`."""
        if not self.path.exists():
            return None
        try:
            return read_background(self.path, height, width)
        except InputError as error:
            raise InputError(f"{error}; or remove it, and call capture_background once the node runs") from error

    def load_calibration(self, sensor: SensorModel) -> SensorCalibration | None:
        """Read the sensor's calibration, of any scale; None if none was kept. InputError if it is broken or of another
        sensor."""
        if not self.calibration_path.exists():
            return None
        calibration = SensorCalibration.load(self.calibration_path)
        try:
            calibration.check_kind(sensor, self._serial)
        except InputError as error:
            raise InputError(f"{self.calibration_path}: {error}") from error
        return calibration

    def keep(self, image: np.ndarray) -> str:
        """Save an image and return a message: where it is kept, or why it could not be kept although it is in use."""
        try:
            self.save(image)
        except InputError as error:
            return f"in use, but {error}"
        return f"kept in {self.path}"

    def save(self, image: np.ndarray) -> None:
        """Write an image (H, W, 3) uint8 RGB in place of the last one; InputError if it cannot be written."""
        encoded = cv2.imencode(".png", cv2.cvtColor(image, cv2.COLOR_RGB2BGR))[1]
        try:
            with atomic_path(self.path) as temporary:
                temporary.write_bytes(encoded.tobytes())
        except OSError as error:
            raise InputError(f"{self.path}: {error.strerror or error}; the background was not kept") from error


class SensorBackground:
    """No-contact image that a sensor's images are compared with, and its source.

    The source is, in this order: a captured image, a file, an image kept from an earlier start, an estimate from the
    first images.

    Attributes: image (H, W, 3) uint8 RGB, None before the first one; source, as text; problem with the image and its
    fix, "" if there is none.

    Parameters
    ----------
    sensor
        At image resolution.
    path
        An image or a folder of images; may be empty.
    store
        Images of earlier starts.
    frames
        Number of images for an estimate.

    Raises
    ------
    InputError
        As for `read_background`.
    """

    def __init__(self, sensor: SensorModel, path: str | Path, store: BackgroundStore | None, frames: int):
        self._layout = shipped_layout() if sensor.lamps == DIGIT_LAMPS else None
        self._store = store
        self._running: RunningBackground | None = None
        self.image: np.ndarray | None = None
        self.source, self.problem = "none yet", ""
        size = sensor.height, sensor.width
        if path:
            self._set(read_background(path, *size), f"file {path}")
        elif store is not None and (kept := store.load(*size)) is not None:
            self._set(kept, f"kept in {store.path}")
        else:
            self._running = RunningBackground(frames)

    @property
    def change(self) -> float:
        """Largest change [grey levels] among the images of the estimate; 0 if the image is not estimated."""
        return self._running.change if self._running is not None else 0.0

    def doubt(self, still_threshold: float) -> str:
        """Return why an estimate is doubtful, if its images changed by more than `still_threshold` [grey levels]; else
        empty."""
        if self.change <= still_threshold:
            return ""
        kept = f", as none of {self._store.path.stem} is kept," if self._store else ""
        return (
            f"the background was estimated{kept} while the images changed; "
            "lift the finger and call capture_background, or set the parameter background"
        )

    def observe(self, image: np.ndarray) -> None:
        """Take one more image (H, W, 3) uint8 of the sensor."""
        if self._running is None:
            return
        self._running.add(image)
        if self._running.image is not self.image:
            self._set(self._running.image, f"the first {self._running.count} images")

    def replace(self, image: np.ndarray) -> str:
        """Use a captured image (320, 240, 3) uint8 RGB; return a message on whether it is kept for the next start."""
        self._running = None
        self._set(image, "capture_background")
        return self._store.keep(image) if self._store else "not kept for the next start: set the parameter serial"

    def _set(self, image: np.ndarray, source: str) -> None:
        self.image, self.source = image, source
        self.problem = image_problem(image, self._layout) or view_problem(image)
