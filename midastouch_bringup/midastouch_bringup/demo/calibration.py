"""What a calibration is worth: a simulated sensor feels an object before and after ten presses of a ball."""

from __future__ import annotations

import numpy as np

from midastouch_common.mesh import ObjectMesh
from midastouch_perception.rendering.contact_poses import ContactSampling, sample_contact_poses
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_calibration.fit import Result, calibrate
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.simulation.simulated_digit import PressedSensor
from midastouch_perception.tdn import load_tdn

from ..datasets.slide_simulation import no_contact_image
from ..drawing.relief_rows import ReliefRow, felt_with

_RADIUS = 3e-3  # m
_SEED = 6  # of a sensor on which the network alone feels too deep
_PRESSES, _TOUCHES = 10, 6
_FIRM = ContactSampling(press=(0.6e-3, 1.4e-3), free_fraction=0.0)


def calibrated_touches(mesh: ObjectMesh) -> tuple[Result, list[ReliefRow]]:
    """A calibration, and touches of the mesh as that sensor feels them: before, after, and in truth."""
    rng = np.random.default_rng(_SEED)
    sensor = SensorModel.load("digit_real")
    digit = PressedSensor(sensor, no_contact_image(sensor, rng)[None], _RADIUS, rng)
    result = calibrate(digit.presses(_PRESSES), digit.background, 2 * _RADIUS, sensor, diameter_is_right=True)
    tdn = load_tdn("fast", sensor)
    rows = []
    for truth in PenetrationRenderer(mesh, sensor).render(sample_contact_poses(mesh, _TOUCHES, rng, sensor, _FIRM)):
        image = digit.image_of(truth)
        felt = [felt_with(tdn, each, image, digit.background) for each in (None, result.calibration)]
        tdn.calibration = None
        change = tdn.difference(image, digit.background)
        rows.append(ReliefRow("image", image, change, (*felt, truth)))
    return result, rows
