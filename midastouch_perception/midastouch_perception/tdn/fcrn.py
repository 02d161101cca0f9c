"""Camera image to penetration map with the paper's own depth network (FCRN) and imported weights."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from ..sensor_calibration.calibration import SensorCalibration
from ..sensor_model import SensorModel
from .depth_net import DepthNet
from .inputs import check_image

HEIGHT_UNIT = 3e-5  # m a grey level of the height maps it was trained on
# The net is a regression of height: on untouched gel it errs by some units to either side. As in the official code,
# less than five of them is no contact.
_FLOOR = 5 * HEIGHT_UNIT


class FcrnDepthNet(DepthNet):
    """The paper's depth network, which needs no background: it was trained on whole images.

    It works at the image's resolution and takes some 0.2 s a frame on one core.
    """

    has_embedding = False

    def __init__(
        self,
        name_or_path: str | Path,
        sensor: SensorModel | None = None,
        calibration: SensorCalibration | None = None,
    ):
        super().__init__(name_or_path, sensor, calibration)
        self._sag = (self.sensor.gel_distance - self.sensor.gel_depth).astype(np.float32)

    def height(self, image: np.ndarray) -> np.ndarray:
        """What the network itself gives: height (320, 240) float32 m above the plane through the gel's apex.

        image: (320, 240, 3) uint8 RGB, stretched to the full range over all channels together as in the official code.
        """
        check_image(image, self._image_sensor, "tactile image")
        stretched = cv2.normalize(image, None, 0, 255, cv2.NORM_MINMAX)
        batch = np.ascontiguousarray(np.moveaxis(stretched, -1, 0)[None], np.float32)
        return self._network.run(batch)[0, 0] * np.float32(HEIGHT_UNIT)

    def predict(self, image: np.ndarray, background: np.ndarray, difference: np.ndarray | None = None) -> np.ndarray:
        """Penetration (160, 120) float32 m of one image: its height above the undeformed gel, each pixel the mean of
        four. The background is not used."""
        height = cv2.resize(self.height(image), self._sag.shape[::-1], interpolation=cv2.INTER_AREA)
        penetration = height - self._sag
        return np.where(penetration >= _FLOOR, penetration, np.float32(0))
