"""What the pipeline needs of a depth network, whatever is inside, and the calibration that it is given."""

from __future__ import annotations

from abc import ABC, abstractmethod
from pathlib import Path

import numpy as np

from ..onnx_network import OnnxNetwork
from ..sensor_calibration.calibration import SensorCalibration, scale_problem
from ..sensor_model import SensorModel
from .inputs import ContactLight, check_image, reduce_image


class DepthNet(ABC):
    """A tactile depth network in an ONNX file: image and background to penetration (paper section 4.1).

    Args: name_or_path; sensor, full size; calibration, of that sensor, or None; the attribute may be set anew. Raises
    InputError if the calibration is another sensor model's.
    Attributes: network_id; sensor, the map-resolution sensor model.
    """

    _threads = 1

    def __init__(
        self,
        name_or_path: str | Path = "fast",
        sensor: SensorModel | None = None,
        calibration: SensorCalibration | None = None,
    ):
        self._network = OnnxNetwork("tdn", name_or_path, self._threads)
        self._image_sensor = sensor or SensorModel.load("digit_tacto")
        self.sensor = self._image_sensor.for_maps
        self._background: tuple[np.ndarray, ContactLight] | None = None
        if calibration is not None:
            calibration.check_sensor(self._image_sensor)
        self.calibration = calibration

    @property
    def network_id(self) -> str:
        return self._network.network_id

    @property
    @abstractmethod
    def has_embedding(self) -> bool:
        """Whether the network also gives its bottleneck."""

    def difference(self, image: np.ndarray, background: np.ndarray) -> np.ndarray:
        """Difference (160, 120, 3) float32 grey levels of image and background (320, 240, 3) uint8 RGB.

        The frame's own brightness is taken off; relative light is scaled to a background of 100 (`ContactLight`). With
        a calibration it is the difference that a standard sensor would show. Raises InputError on wrong size or type.
        The last background is kept reduced: do not write into it.
        """
        if self._background is None or self._background[0] is not background:
            check_image(background, self._image_sensor, "background")
            self._background = background, ContactLight(reduce_image(background), self.sensor.light)
        reduced = reduce_image(check_image(image, self._image_sensor, "tactile image"))
        change = self._background[1].difference(reduced)
        return self.calibration.standardised(change) if self.calibration else change

    @abstractmethod
    def predict(self, image: np.ndarray, background: np.ndarray, difference: np.ndarray | None = None) -> np.ndarray:
        """Penetration (160, 120) float32 m of one image; 0 where the network sees no contact.

        difference: `difference(image, background)`, if at hand.
        """


class CalibrationInUse:
    """Gives a calibration to a depth network, and takes it back where the no-contact image is another gel's.

    Args: tdn; calibration, of the same kind of sensor: of another scale, it is not given; sensor, tdn's, full size.
    Attribute: problem, why it is not used; empty if it is, or there is none.
    """

    def __init__(self, tdn: DepthNet | None, calibration: SensorCalibration | None, sensor: SensorModel):
        self._tdn, self._calibration = tdn, calibration
        self._other_scale = scale_problem(sensor, calibration.pixel_size) if calibration else ""
        self._decide(self._other_scale)

    def check(self, background: np.ndarray) -> None:
        """The no-contact image (H, W, 3) uint8 RGB in use from now on."""
        if self._calibration is not None:
            self._decide(self._other_scale or self._calibration.background_problem(background))

    def _decide(self, problem: str) -> None:
        self.problem = problem
        if self._calibration is not None:
            self._tdn.calibration = None if problem else self._calibration

    def __str__(self) -> str:
        """What is in use, in words."""
        if self._calibration is None:
            return "none"
        if self.problem:
            return "refused"
        return f"{self._calibration.touched}, {self._calibration.date}"
