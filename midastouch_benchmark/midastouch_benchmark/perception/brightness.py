"""What a change of exposure does to felt depth: images of presses made darker and brighter as a whole."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from midastouch_bringup.datasets.ball_presses import BallPresses
from midastouch_perception.sensor_calibration.calibration import SensorCalibration
from midastouch_perception.tdn import DepthNet

CHANGES = 0.9, 1.1


def brightness_effect(
    tdn: DepthNet, presses: BallPresses, calibrations: Mapping[str, SensorCalibration] | None = None
) -> float:
    """Root mean square over all pixels [m] by which the map of a press changes with its brightness.

    The larger of the two of `CHANGES` for each press, of which the median. The no-contact image stays as it is;
    calibrations: of each press, as in `measure_presses`.
    """
    effects = []
    for name, image in presses.images.items():
        if calibrations is not None:
            tdn.calibration = calibrations[name]
        felt = tdn.predict(image, presses.background)
        changed = [np.clip(np.rint(factor * image.astype(np.float32)), 0, 255).astype(np.uint8) for factor in CHANGES]
        errors = [tdn.predict(other, presses.background) - felt for other in changed]
        effects.append(max(float(np.sqrt(np.mean(error**2))) for error in errors))
    return float(np.median(effects))
