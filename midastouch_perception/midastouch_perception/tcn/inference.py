"""Trained code network: from penetration map to tactile code, and the network's input for a contact."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np

import midastouch_kernels as kernels

from ..onnx_network import OnnxNetwork, code_settings
from ..sensor_model import SensorModel
from .minkloc3d import SUFFIX, MinkLocCodeNet

_BATCH = 64


class TactileCodeNet:
    """Tactile code network (TCN): from contact geometry to a unit vector (paper section 4.2).

    Attributes: network_id; dim, length of a code; calibration, {"temperature", "outlier"} of the score (see
    `tcn/train.py`); sensor, the map-resolution sensor model.

    Parameters
    ----------
    name_or_path, sensor
        As for `load_tcn`.
    """

    def __init__(self, name_or_path: str | Path = "fast", sensor: SensorModel | None = None):
        self._network = OnnxNetwork("tcn", name_or_path)
        self._network.require_inputs("maps")
        self.sensor = (sensor or SensorModel.load("digit_tacto")).for_maps
        self.dim, self.calibration = code_settings(self._network.card, self._network.path)

    @property
    def network_id(self) -> str:
        return self._network.network_id

    def encode(self, penetration: np.ndarray) -> np.ndarray:
        """Encode penetration maps.

        Parameters
        ----------
        penetration : (H, W) or (N, H, W) [m]

        Returns
        -------
        (D,) or (N, D) float32
            Codes of length 1.
        """
        single = penetration.ndim == 2
        maps = penetration[None] if single else penetration
        codes = [self._network.run(code_input(maps[i : i + _BATCH], self.sensor)) for i in range(0, len(maps), _BATCH)]
        out = np.concatenate(codes) if codes else np.empty((0, self.dim), np.float32)
        return out[0] if single else out


AnyCodeNet = TactileCodeNet | MinkLocCodeNet


def load_tcn(name_or_path: str | Path = "fast", sensor: SensorModel | None = None) -> AnyCodeNet:
    """Load a code network. MinkLoc3D runs with as many threads as NumPy's matrix products, the other with one.

    Parameters
    ----------
    name_or_path
        `fast`, or a file (ONNX, or an imported MinkLoc3D).
    sensor
        Sensor of the maps, at image resolution; `digit_tacto` if None.

    Raises
    ------
    InputError
        No such network.
    """
    if Path(name_or_path).suffix == SUFFIX:
        return MinkLocCodeNet(name_or_path, sensor)
    return TactileCodeNet(name_or_path, sensor)


def code_input(penetration: np.ndarray, sensor: SensorModel) -> np.ndarray:
    """Return channels (N, 4, H/2, W/2) float32 of penetration maps (N, H, W) m: depth, contact, x, y.

    The map is averaged 2 x 2. The metric scale and the position in the gel frame, which the official code normalises
    away, are kept: x and y are the pixels' positions on the gel.
    """
    n, height, width = penetration.shape
    out = np.empty((n, 4, height // 2, width // 2), np.float32)
    for each, channels in zip(penetration, out, strict=True):
        channels[0] = kernels.block_means(np.ascontiguousarray(each), 2, 2) * np.float32(1e3)
        channels[1] = kernels.block_means((each > 0).astype(np.float32), 2, 2)
    out[:, 2:] = _gel_positions(sensor)
    return out


@lru_cache(maxsize=16)
def _gel_positions(sensor: SensorModel) -> np.ndarray:
    """Return x and y (2, H/2, W/2) float32 of the halved map's pixels on the gel, in centimetres."""
    coarse = sensor.scaled(0.5)
    return (np.stack(coarse.rays) * coarse.gel_depth * 100).astype(np.float32)
