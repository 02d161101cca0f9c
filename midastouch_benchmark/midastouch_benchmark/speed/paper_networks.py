"""Speed of the paper's own networks, for comparison with ours."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.state_dict import random_state
from midastouch_perception.tcn import load_tcn, minkloc3d_network
from midastouch_perception.tcn.minkloc3d import save_minkloc3d
from midastouch_perception.tdn import fcrn, load_tdn
from midastouch_perception.tdn.fcrn_graph import save_fcrn

from .timing import Stopwatch

_VOXEL_SIZE = 1e-3  # the official one


def paper_network_times(images: list[np.ndarray], penetrations: list[np.ndarray], sensor: SensorModel) -> dict:
    """{"fcrn_ms", "minkloc3d_ms"}: times of one image (320, 240, 3) uint8 and one penetration map (160, 120) m.

    With random weights, on which speed does not depend: official ones need not be at hand. Writes and removes 254 MB
    of them.
    """
    rng = np.random.default_rng(0)
    with tempfile.TemporaryDirectory() as folder:
        state = random_state(fcrn.expected_shapes(), rng)
        tdn = load_tdn(save_fcrn(state, {"network": "tdn_fcrn"}, Path(folder)), sensor)
        state = random_state(minkloc3d_network.expected_shapes(), rng)
        tcn = load_tcn(save_minkloc3d(state, {"network": "tcn_minkloc3d"}, Path(folder), _VOXEL_SIZE), sensor)
    return {
        "fcrn_ms": _each(lambda image: tdn.predict(image, image), images),
        "minkloc3d_ms": _each(tcn.encode, penetrations),
    }


def _each(call: Callable[[np.ndarray], object], inputs: list[np.ndarray]) -> dict[str, float]:
    call(inputs[0])  # what is made on first use
    stopwatch = Stopwatch()
    for values in inputs:
        with stopwatch:
            call(values)
    return stopwatch.summary()
