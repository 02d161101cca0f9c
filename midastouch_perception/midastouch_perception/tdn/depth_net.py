"""Interface of depth networks for the pipeline, and management of the calibration that one uses."""

from __future__ import annotations

from abc import ABC, abstractmethod
from pathlib import Path

import numpy as np

from ..backends import CPU
from ..onnx_network import OnnxNetwork
from ..sensor_calibration.calibration import SensorCalibration, scale_problem
from ..sensor_model import SensorModel
from .inputs import ContactLight, check_image, reduce_image


class DepthNet(ABC):
    """Tactile depth network in an ONNX file: from image and background to penetration (paper section 4.1).

    Attributes: network_id; backend, the name of the one in use; uses_calibration, true if a calibration changes the
    result; sensor, the map-resolution sensor model; calibration_in_use, the sensor's own, otherwise the default one of
    its lamps, or None. The attribute `calibration` may be set again later.

    Parameters
    ----------
    name_or_path, sensor, calibration, backend
        As for `load_tdn`.

    Raises
    ------
    InputError
        The calibration is of another sensor model.
    """

    _threads = 1
    uses_calibration = True

    def __init__(
        self,
        name_or_path: str | Path = "fast",
        sensor: SensorModel | None = None,
        calibration: SensorCalibration | None = None,
        backend: str = CPU,
    ):
        self._network = OnnxNetwork("tdn", name_or_path, self._threads, backend)
        self._image_sensor = sensor or SensorModel.load("digit_tacto")
        self.sensor = self._image_sensor.for_maps
        self._background: tuple[np.ndarray, ContactLight] | None = None
        if calibration is not None:
            calibration.check_sensor(self._image_sensor)
        self._default = SensorCalibration.default(self._image_sensor)
        self.calibration = calibration
        self._prepare()

    @abstractmethod
    def _prepare(self) -> None:
        """Make what one kind of network needs further."""

    @property
    def calibration_in_use(self) -> SensorCalibration | None:
        return self.calibration or self._default

    @property
    def network_id(self) -> str:
        return self._network.network_id

    @property
    def backend(self) -> str:
        return self._network.backend

    def difference(self, image: np.ndarray, background: np.ndarray) -> np.ndarray:
        """Return the network's input: `shown` of the `change`.

        Parameters
        ----------
        image, background : (320, 240, 3) uint8 RGB

        Returns
        -------
        (160, 120, 3) float32 [grey levels]
        """
        return self.shown(self.change(image, background))

    def shown(self, change: np.ndarray) -> np.ndarray:
        """Return the network's input for a change (160, 120, 3) grey levels: with a calibration, the change of a
        standard sensor."""
        return self.calibration_in_use.standardised(change) if self.calibration_in_use else change

    def change(self, image: np.ndarray, background: np.ndarray) -> np.ndarray:
        """Return the change from the no-contact image to an image.

        The frame's own brightness is removed; relative light is scaled to a background of 100 (`ContactLight`).

        Parameters
        ----------
        image : (320, 240, 3) uint8 RGB
        background : (320, 240, 3) uint8 RGB
            The last one is kept in reduced form: do not write into it.

        Returns
        -------
        (160, 120, 3) float32 [grey levels]

        Raises
        ------
        InputError
            An image of another size or type.
        """
        if self._background is None or self._background[0] is not background:
            check_image(background, self._image_sensor, "background")
            self._background = background, ContactLight(reduce_image(background), self.sensor.light)
        reduced = reduce_image(check_image(image, self._image_sensor, "tactile image"))
        return self._background[1].difference(reduced)

    @abstractmethod
    def predict(self, image: np.ndarray, background: np.ndarray, difference: np.ndarray | None = None) -> np.ndarray:
        """Return the penetration in one image; 0 where the network detects no contact.

        Parameters
        ----------
        image, background : (320, 240, 3) uint8 RGB
        difference
            `difference(image, background)`, if you have it already.

        Returns
        -------
        (160, 120) float32 [m]
        """

    def depth(self, difference: np.ndarray, penetration: np.ndarray) -> float:
        """Return the depth of a contact's deepest point below the untouched gel; at least the deepest penetration.

        Without a calibration, the depth to which gel sinks in around a contact is unknown, and the result is the
        deepest penetration.

        Parameters
        ----------
        difference : (160, 120, 3), from `difference`
        penetration : (160, 120) of the contact [m]

        Returns
        -------
        [m]
        """
        return float(penetration.max())


class CalibrationInUse:
    """Calibration that a depth network uses only while it fits the no-contact image and the gel.

    Attribute: problem, reason why the calibration is not used; empty if it is used or there is none.

    Parameters
    ----------
    tdn
    calibration
        Of the same kind of sensor; one of another scale is not used.
    sensor
        The sensor of `tdn`, full size.
    """

    def __init__(self, tdn: DepthNet | None, calibration: SensorCalibration | None, sensor: SensorModel):
        self._tdn, self._calibration, self._sensor = tdn, calibration, sensor
        self._other_scale = scale_problem(sensor, calibration.pixel_size) if calibration else ""
        self._decide(self._other_scale)

    def check(self, background: np.ndarray) -> None:
        """Decide again, for the no-contact image (H, W, 3) uint8 RGB that is in use from now on."""
        if self._calibration is not None:
            self._decide(self._other_scale or self._calibration.background_problem(background))

    def refuse(self, problem: str) -> None:
        """Stop using the calibration until the next no-contact image, for a reason as text."""
        if self._calibration is not None and not self.problem:
            self._decide(problem)

    def _decide(self, problem: str) -> None:
        self.problem = problem
        if self._calibration is not None:
            self._tdn.calibration = None if problem else self._calibration

    def __str__(self) -> str:
        """Return a description of the calibration in use."""
        if self._tdn is not None and not self._tdn.uses_calibration:
            return "not used by this network"
        if self._calibration is not None and not self.problem:
            return f"{self._calibration.touched}, {self._calibration.date}"
        words = ["refused"] if self.problem else []
        words += [f"that of the model {self._sensor.lamps}"] if SensorCalibration.default(self._sensor) else []
        return ", ".join(words) or "none"
