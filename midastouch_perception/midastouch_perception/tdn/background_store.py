"""Captured no-contact images and calibrations, one per sensor, kept between starts: each DIGIT looks different."""

from __future__ import annotations

import os
import re
from pathlib import Path

import cv2
import numpy as np

from midastouch_common.errors import InputError
from midastouch_common.files import atomic_path

from ..sensor_calibration.calibration import SensorCalibration
from ..sensor_model import SensorModel
from .background_file import read_background


def default_folder() -> Path:
    """Where ROS keeps what nodes remember: below $ROS_HOME, or ~/.ros."""
    return Path(os.environ.get("ROS_HOME") or "~/.ros").expanduser() / "midastouch" / "backgrounds"


def store_of(folder: str, serial: str) -> BackgroundStore | None:
    """The store that a node's parameters name ("": the default folder); None without a serial number."""
    return BackgroundStore(Path(folder).expanduser() if folder else default_folder(), serial) if serial else None


class BackgroundStore:
    """The image of the sensor with this serial number in a folder, as `SERIAL.png`; its calibration, beside it.

    Raises InputError for a serial number that could not be a file's name.
    """

    def __init__(self, folder: Path, serial: str):
        if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}", serial):
            raise InputError(f"serial '{serial}': not a serial number; letters, digits, '.', '_' and '-' only")
        self.path = folder / f"{serial}.png"
        self.calibration_path = folder / f"{serial}.calibration.npz"
        self._serial = serial

    def load(self, height: int, width: int) -> np.ndarray | None:
        """RGB image (height, width, 3) uint8; None if none was kept. InputError as `read_background`."""
        return read_background(self.path, height, width) if self.path.exists() else None

    def load_calibration(self, sensor: SensorModel) -> SensorCalibration | None:
        """The sensor's calibration, of any scale; None if none was kept. InputError if it is broken or another
        sensor's."""
        if not self.calibration_path.exists():
            return None
        calibration = SensorCalibration.load(self.calibration_path)
        try:
            calibration.check_kind(sensor, self._serial)
        except InputError as error:
            raise InputError(f"{self.calibration_path}: {error}") from error
        return calibration

    def keep(self, image: np.ndarray) -> str:
        """As `save`; says in words where it is kept, or why it is not: it can be used all the same."""
        try:
            self.save(image)
        except InputError as error:
            return f"in use, but {error}"
        return f"kept in {self.path}"

    def save(self, image: np.ndarray) -> None:
        """Keep an image (H, W, 3) uint8 RGB in place of the last one; InputError if it cannot be written."""
        encoded = cv2.imencode(".png", cv2.cvtColor(image, cv2.COLOR_RGB2BGR))[1]
        try:
            with atomic_path(self.path) as temporary:
                temporary.write_bytes(encoded.tobytes())
        except OSError as error:
            raise InputError(f"{self.path}: {error.strerror or error}; the background was not kept") from error
