"""Penetration map to tactile code with a trained code network."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..onnx_network import OnnxNetwork
from ..sensor_model import SensorModel
from .inputs import code_input
from .minkloc3d import SUFFIX, MinkLocCodeNet

_BATCH = 64


class TactileCodeNet:
    """The tactile code network (TCN): contact geometry to a unit vector (paper section 4.2).

    Attributes: network_id; dim, length of a code; calibration, {"temperature", "outlier"} of the score (see
    `tcn/train.py`); sensor, the map-resolution sensor model.
    """

    def __init__(self, name_or_path: str | Path = "fast", sensor: SensorModel | None = None):
        self._network = OnnxNetwork("tcn", name_or_path)
        self.sensor = (sensor or SensorModel.load("digit_tacto")).for_maps
        self.dim = int(self._network.card["dim"])
        self.calibration: dict[str, float] = self._network.card["calibration"]

    @property
    def network_id(self) -> str:
        return self._network.network_id

    def encode(self, penetration: np.ndarray) -> np.ndarray:
        """Codes (D,) or (N, D) float32, L2-normalised, of penetration maps (H, W) or (N, H, W) m."""
        single = penetration.ndim == 2
        maps = penetration[None] if single else penetration
        codes = [self._network.run(code_input(maps[i : i + _BATCH], self.sensor)) for i in range(0, len(maps), _BATCH)]
        out = np.concatenate(codes) if codes else np.empty((0, self.dim), np.float32)
        return out[0] if single else out


def load_tcn(name_or_path: str | Path = "fast", sensor: SensorModel | None = None) -> TactileCodeNet | MinkLocCodeNet:
    """A code network by name (`fast`) or path (ONNX, or an imported MinkLoc3D), for maps of `sensor` (default
    `digit_tacto`). MinkLoc3D runs with as many threads as NumPy's matrix products, the other with one."""
    if Path(name_or_path).suffix == SUFFIX:
        return MinkLocCodeNet(name_or_path, sensor)
    return TactileCodeNet(name_or_path, sensor)
