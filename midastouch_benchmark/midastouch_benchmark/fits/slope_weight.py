"""Fit the weight of the depth network's slopes relative to those of a sensor's calibration, on measured sensors.

.venv/bin/python -m midastouch_benchmark.fits.slope_weight --meshes ../shared/meshes/ycb [--every N]

The result is `NETWORK_WEIGHT` of `midastouch_perception/tdn/slope_fusion.py`: the weight with which the joined slopes
are nearest to the true ones. The touches are slides over training objects; the sensors are those whose optics were
measured, each calibrated by ten simulated presses of a ball.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from midastouch_common.mesh import ObjectMesh
from midastouch_perception.contact import TOUCHED
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_calibration.calibration import plain_slopes
from midastouch_perception.sensor_calibration.response import height_slopes
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tdn.inference import TactileDepthNet, load_tdn
from midastouch_simulation.measured_optics import MeasuredOptics, MeasuredSensor, measured_sensors
from midastouch_simulation.slide import simulate_slide

from ..trials.object_sets import meshes_to_fit_on
from ..trials.real_sensor import calibrate_measured

_LENGTH, _STEP = 0.12, 6e-3  # m of a slide, and between its touches
_STEEPEST = 1.0  # slope: walls are not visible
_FEWEST = 40  # px of a contact


def best_weight(errors: np.ndarray) -> float:
    """Return the weight of the second of two estimates with which their mean errs least; errors: (2, N) of both."""
    (first, common), (_, second) = errors @ errors.T / errors.shape[1]
    return float((first - common) / (first + second - 2 * common))


def slope_errors(
    tdn: TactileDepthNet, images: list[np.ndarray], background: np.ndarray, maps: np.ndarray
) -> np.ndarray:
    """Return errors (2, N) of slopes in the contacts of images: by the calibration in use, and by the network.

    maps: (N, H, W) m, the true penetration of each image.
    """
    pixel, errors = tdn.sensor.pixel_size, [np.zeros((2, 0))]
    for image, true in zip(images, maps, strict=True):
        difference = tdn.difference(image, background)
        wanted = height_slopes(true, pixel)
        judged = (true > TOUCHED) & (np.abs(wanted).max(axis=-1) < _STEEPEST)
        if judged.sum() >= _FEWEST:
            both = plain_slopes(difference), height_slopes(tdn.network_penetration(difference), pixel)
            errors.append(np.stack([(each - wanted)[judged].ravel() for each in both]))
    return np.concatenate(errors, axis=1)


def main() -> None:
    """Print the weight for each object, and the one over all."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--meshes", type=Path, required=True, help="YCB scans; the test objects are left out")
    parser.add_argument("--every", type=int, default=1, help="n-th training scan is taken")
    args = parser.parse_args()
    sensor = SensorModel.load("digit_real")
    optics = [MeasuredOptics.load(name) for name in measured_sensors()]
    nets = [
        load_tdn("fast", sensor, calibrate_measured(each, sensor, np.random.default_rng(k)))
        for k, each in enumerate(optics)
    ]
    found = []
    for number, path in enumerate(meshes_to_fit_on(args.meshes)[:: args.every]):
        mesh = ObjectMesh.load(path)
        poses = simulate_slide(mesh, sensor, _LENGTH, np.random.default_rng(number), _STEP)
        maps = PenetrationRenderer(mesh, sensor.for_maps).render(poses)
        for each, tdn in zip(optics, nets, strict=True):
            camera = MeasuredSensor(each, sensor, np.random.default_rng(number))
            found.append(slope_errors(tdn, list(camera.images(maps)), camera.background, maps))  # type: ignore[arg-type] # "fast" is one
        print(f"{mesh.name}: {best_weight(np.concatenate(found[-len(nets) :], axis=1)):.2f}", flush=True)
    print(f"NETWORK_WEIGHT {best_weight(np.concatenate(found, axis=1)):.2f}, {len(found) // len(nets)} objects")


if __name__ == "__main__":
    main()
