"""Trained depth network: from camera image to penetration map."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..backends import CPU
from ..onnx_network import WEIGHTS, network_path, read_card
from ..sensor_calibration.calibration import SensorCalibration, plain_slopes
from ..sensor_model import SensorModel
from .depth_net import DepthNet
from .fcrn import FcrnDepthNet
from .inputs import difference_input, geometry_input
from .slope_fusion import depth_below_gel, joined_depth

_LEARNT_ON = {"additive": "digit_tacto", "relative": "digit_real"}
"""The sensor in the middle of those that a network was trained for, by `SensorModel.light`."""


class TactileDepthNet(DepthNet):
    """Our depth network, whose input is the difference from the no-contact image.

    It recognises slopes and hardly regards the scale. So its depths are scaled by the sensor's pixel size relative to
    that of its training, and on a calibrated sensor its slopes are joined with those of the colours (`slope_fusion`).
    """

    _threads = 2  # one thread would be busy for three quarters of the time, with the second core idle

    def _prepare(self) -> None:
        self._network.require_inputs("difference", "geometry")
        self._geometry = geometry_input(self.sensor)[None]
        learnt = SensorModel.load(_LEARNT_ON[self.sensor.light]).for_maps
        self._metres = np.float32(1e-3 * self.sensor.pixel_size / learnt.pixel_size)  # m per millimetre of its output

    def predict(self, image: np.ndarray, background: np.ndarray, difference: np.ndarray | None = None) -> np.ndarray:
        return self.penetration(self.difference(image, background) if difference is None else difference)

    def penetration(self, difference: np.ndarray) -> np.ndarray:
        """Return penetration (160, 120) or (N, 160, 120) m of difference images (160, 120, 3) or (N, 160, 120, 3)."""
        penetration = self.network_penetration(difference)
        return penetration if self.calibration_in_use is None else self._joined(difference, penetration)

    def network_penetration(self, difference: np.ndarray) -> np.ndarray:
        """Return the same by the network alone, without the calibration's slopes."""
        out = self._network.run(*self._batch(difference))
        penetration = np.where(out[:, 1] > 0, np.maximum(out[:, 0], 0), 0) * self._metres
        return penetration.reshape(difference.shape[:-1])

    def depth(self, difference: np.ndarray, penetration: np.ndarray) -> float:
        if self.calibration_in_use is None:
            return super().depth(difference, penetration)
        return depth_below_gel(plain_slopes(difference), penetration, self.sensor.pixel_size)

    def _joined(self, difference: np.ndarray, penetration: np.ndarray) -> np.ndarray:
        if difference.ndim == 3:
            return joined_depth(
                plain_slopes(difference), penetration, self.sensor.pixel_size, self.calibration_in_use.fusion
            )
        return np.stack([self._joined(*each) for each in zip(difference, penetration, strict=True)])

    def _batch(self, difference: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        batch = difference_input(np.atleast_1d(difference).reshape(-1, *difference.shape[-3:]))
        geometry = np.broadcast_to(self._geometry, (len(batch), *self._geometry.shape[1:]))
        return batch, np.ascontiguousarray(geometry)


def load_tdn(
    name_or_path: str | Path = "fast",
    sensor: SensorModel | None = None,
    calibration: SensorCalibration | None = None,
    backend: str = CPU,
) -> DepthNet:
    """Load a depth network.

    For a name, the one trained for the sensor's light is taken, e.g. `fast_relative` for real gel.

    Parameters
    ----------
    name_or_path
        `fast`, or an ONNX file.
    sensor
        Sensor of the images, full size; `digit_tacto` if None.
    calibration
        Calibration of that very sensor, or None.
    backend
        As for `load_backend`.

    Raises
    ------
    InputError
        Unknown network or backend, or calibration of another sensor.
    """
    sensor = sensor or SensorModel.load("digit_tacto")
    if (WEIGHTS / f"tdn_{name_or_path}_{sensor.light}.onnx").is_file():
        name_or_path = f"{name_or_path}_{sensor.light}"
    card = read_card(network_path("tdn", name_or_path))
    network = FcrnDepthNet if card.get("architecture") == "fcrn" else TactileDepthNet
    return network(name_or_path, sensor, calibration, backend)
