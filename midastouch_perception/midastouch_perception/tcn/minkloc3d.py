"""The paper's own code network (MinkLoc3D), with imported weights: from penetration map to tactile code."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from midastouch_common.errors import InputError
from midastouch_common.files import atomic_path, readable, require_file

from ..arrays import read_npz
from ..onnx_network import code_settings, network_id, read_card, write_card
from ..pointcloud import cloud_from_penetration
from ..sensor_model import SensorModel
from ..state_dict import matched
from .minkloc3d_network import DIM, MinkLoc3D, Voxels, expected_shapes, quantise

SUFFIX = ".npz"
_POINTS = 4096  # of a cloud, as in the official code
_VOXEL_SIZE = "voxel_size"
# The filter's score needs a calibration, which our networks get in training. Imported ones have the paper's softmax of
# cosines (temperature 1), and one touch in a hundred that matches no entry.
_CALIBRATION = {"temperature": 1.0, "outlier": 0.01}


class MinkLocCodeNet:
    """MinkLoc3D with the interface of `TactileCodeNet`.

    Attributes: network_id; dim; calibration; sensor, the map-resolution sensor model. Raises InputError: no such
    file, not a MinkLoc3D network, no model card.
    """

    def __init__(self, path: str | Path, sensor: SensorModel | None = None):
        path = require_file(path, "tcn network")
        with readable(path, "not a MinkLoc3D network", "run midastouch import-weights again"):
            state = read_npz(path)
            self._voxel_size = float(state.pop(_VOXEL_SIZE))
        self._network = MinkLoc3D(matched(state, expected_shapes(), f"{path}: not a MinkLoc3D network"))
        card = read_card(path)
        self.network_id = network_id(path, card)
        self.dim = DIM
        self.calibration = code_settings(card, path)[1]
        self._image_sensor = sensor or SensorModel.load("digit_tacto")
        self.sensor = self._image_sensor.for_maps

    def encode(self, penetration: np.ndarray) -> np.ndarray:
        """Return codes (D,) or (N, D) float32, L2-normalised, of penetration maps (H, W) or (N, H, W) m.

        The draw of points is the same for every map, so a code depends on its map alone. An empty map has the code
        of a single voxel. Raises InputError for non-finite maps.
        """
        single = penetration.ndim == 2
        maps = penetration[None] if single else penetration
        codes = np.empty((len(maps), self.dim), np.float32)
        for i, values in enumerate(maps):
            code = self._network(self._voxels(values))
            codes[i] = code / np.linalg.norm(code)
        return codes[0] if single else codes

    def _voxels(self, penetration: np.ndarray) -> Voxels:
        if not np.isfinite(penetration).all():
            raise InputError("penetration map: non-finite values; check the depth network's input")
        cloud = contact_cloud(penetration, self._image_sensor, _POINTS, np.random.default_rng(0))
        if not len(cloud):
            return Voxels(np.zeros((1, 3)))
        return quantise(scaled_cloud(cloud), self._voxel_size)


def contact_cloud(penetration: np.ndarray, sensor: SensorModel, points: int, rng: np.random.Generator) -> np.ndarray:
    """Return contact points (K, 3) float32 m, K <= points, camera frame, of a penetration map (H, W) m.

    The map is resized to the resolution of `sensor`, the image's: the network was trained on a point per image pixel.
    If there are too many points, each is kept with the same chance (the official code prefers lower rows).
    """
    size = sensor.width, sensor.height
    mask = cv2.resize((penetration > 0).astype(np.uint8), size, interpolation=cv2.INTER_NEAREST).astype(bool)
    cloud = cloud_from_penetration(cv2.resize(penetration, size, interpolation=cv2.INTER_LINEAR), mask, sensor)
    cloud[:, 2] -= np.float32(sensor.gel_distance)
    return cloud if len(cloud) <= points else cloud[rng.choice(len(cloud), points, replace=False)]


def scaled_cloud(cloud: np.ndarray) -> np.ndarray:
    """Return a cloud (K, 3), K >= 1, moved and scaled so that its smallest coordinate is -1 and its largest 1.

    All axes are scaled together, as in the official code. This loses metric size and position on the gel, but the
    network was trained without them.
    """
    low, high = cloud.min(), cloud.max()
    return 2 * (cloud - low) / (high - low) - 1


def save_minkloc3d(state: dict[str, np.ndarray], card: dict, folder: Path, voxel_size: float) -> Path:
    """Write the network of a state dict and its model card to `folder`; return the network's file.

    The voxel size is part of the file, and thus of the network's identity, because codes depend on it.
    """
    path = folder / f"{card['network']}{SUFFIX}"
    details = {"architecture": "minkloc3d", "dim": DIM, "voxel_size": voxel_size, "calibration": _CALIBRATION}
    with atomic_path(path) as temporary, temporary.open("wb") as stream:
        np.savez(stream, **state, **{_VOXEL_SIZE: np.float64(voxel_size)})  # type: ignore[arg-type] # none has the name of an option
    write_card(card | details, path)
    return path
